"""What a robot docks to in a recording, and the robot: all that perception is told beside the pictures."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.as_built import AsBuiltSpec
from msrr_scenes.specs.bodies import MAX_UNITS, TAGS_PER_UNIT, TagId, TagsSpec, tags_in_dock
from msrr_scenes.specs.control import ControlSpec, LosSpec
from msrr_scenes.specs.mount import MountSpec
from msrr_scenes.specs.sensors import CameraSpec, OdometrySpec
from msrr_scenes.specs.spec import FileName, Name, Spec, Speed, Text, TurnRate
from msrr_scenes.specs.tag_map import TagMapSpec

#: Names of the robot and of the target in the scene of a recording, and of the port of a mapped target.
ROBOT, TARGET, DOCK = "robot", "target", "dock"

#: Name of a joint in messages of joint states.
_JointName = Annotated[str, Field(min_length=1, max_length=255)]


class TargetUnitSpec(Spec):
    """A unit as scenes describe it, to which the robot docks."""

    number: int = Field(ge=0, le=MAX_UNITS - 1)
    """Number n of the unit: its tags have the ids from 10 n on, as those of a unit of a scene."""
    urdf: FileName = "unit.urdf"
    """File name of the URDF: beside this file, in the working folder, or a shipped one."""
    tag_ids: dict[Annotated[str, Field(max_length=255)], TagId] = Field(
        default_factory=dict, max_length=TAGS_PER_UNIT
    )
    """Tag ids that differ from those of the number, by link name."""
    port: Name
    """Port to which the robot docks."""


class MappedMarkerSpec(Spec):
    """A marker of real tags, at the places where they were measured to be."""

    map: TagMapSpec
    """The tags: in a file, the name of a map that ``msrr map`` wrote."""
    dock: MountSpec = MountSpec()
    """Dock frame D, seen from the map's reference tag with x into the tag, y left and z up as one sees it.

    D has its origin on the floor below the face of the port, x into the target and z up: ``z_m`` is minus the
    height of the reference tag above the floor.
    """
    tags: tuple[TagId, ...] | None = Field(default=None, min_length=1, max_length=1000)
    """Ids of the tags that belong to the target; null for all of the map."""

    @model_validator(mode="after")
    def _tags_are_in_the_map(self) -> Self:
        missing = sorted(set(self.tags or ()) - self.map.tags.keys())
        if missing:
            known = ", ".join(map(str, self.map.tags))
            raise ValueError(f"tags {', '.join(map(str, missing))} are not in the map, which has {known}")
        if not self.map.tags:
            raise ValueError("the map has no tags")
        return self

    @property
    def X_DT(self) -> dict[int, SE3]:
        """Pose of every tag of the target in the dock frame, by its id."""
        return tags_in_dock(self.map, self.dock, self.tags)


class RobotSpec(Spec):
    """The robot that carries the camera."""

    urdf: FileName = "unit.urdf"
    """File name of the URDF, which gives wheels, active port and camera: beside this file, in the working
    folder, or a shipped one."""
    port: Name = "front"
    """Active port."""
    camera: MountSpec | None = None
    """Mount of the camera on the robot, frame U: x along the optical axis, z up in the image; null takes that
    of the URDF."""
    wheel_joints: tuple[_JointName, _JointName] | None = None
    """Names of the left and the right wheel in the joint states of a recording; null if it has none."""
    speed_mps: Speed = 0.25
    """Largest speed [m/s], which without odometry is all that is known of the motion."""
    turn_rate_radps: TurnRate = 1.5
    """Largest turn rate [rad/s], likewise."""


class TargetSpec(Spec):
    """What a robot docks to, and the robot; either ``unit`` or ``marker`` says what the target looks like."""

    description: Text = ""
    """What it is, in words."""
    unit: TargetUnitSpec | None = None
    """The target as a unit of a scene."""
    marker: MappedMarkerSpec | None = None
    """The target as tags that were mapped."""
    robot: RobotSpec = RobotSpec()
    """The robot."""
    camera: CameraSpec = CameraSpec()
    """Its camera: calibration, rate, noise, as in a scene."""
    odometry: OdometrySpec = OdometrySpec()
    """Its wheel encoders."""
    tags: TagsSpec = TagsSpec()
    """Family and sizes of the tags of a unit; a map has its own."""
    as_built: AsBuiltSpec = AsBuiltSpec()
    """Tolerances of robot and target; ``careful`` and other grades as in a scene."""
    los: LosSpec = LosSpec()
    """Target and cone of the line of sight; the target of mapped tags is given by the outermost of them."""
    control: ControlSpec = ControlSpec()
    """Estimator, detector and ``delay_compensation``; all else would change nothing, and is refused."""

    @model_validator(mode="after")
    def _has_one_target(self) -> Self:
        if (self.unit is None) == (self.marker is None):
            raise ValueError("expected either unit or marker, which say what the target looks like")
        return self
