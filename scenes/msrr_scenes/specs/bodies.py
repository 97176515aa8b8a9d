"""Specifications of the bodies in the arena, units and obstacles, and of the tags on them."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.frame_map import FrameMap, MappedFrame
from msrr_scenes.geometry.pinhole import body_pose
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid
from msrr_scenes.specs.mount import FrameSpec, LinkName, MountSpec
from msrr_scenes.specs.spec import Coordinate, FileName, Name, PoseSpec, Size, Spec, Time
from msrr_scenes.specs.tag_families import FAMILIES, TAG36H11, FamilyName, TagFamily
from msrr_scenes.specs.tag_map import TagMapSpec

#: Links of the tags on the masts of ports.
_MAST = re.compile("port_[^_]+_marker_middle")

TAGS_PER_UNIT = 10

#: Largest number of frames of a unit that a scene may name.
MOST_FRAMES = 1000

#: Number of units for which the default tag family has ids.
MAX_UNITS = 50

#: Number of tags of the largest family; whether the family of a scene has an id is checked with the scene.
MOST_TAGS = max(family.ids for family in FAMILIES.values())

TagId = Annotated[int, Field(ge=0, lt=MOST_TAGS)]

#: Height of the face of an obstacle's tag above the lid [m]: the thickness of the plate that carries the tag.
TAG_PLATE_M = 0.002


class ArenaSpec(Spec):
    """The rectangle of floor in which all bodies start, and which no unit may leave with its axle."""

    x_m: tuple[Coordinate, Coordinate] = (-2.0, 2.0)
    """Lowest and highest x of the floor in the world frame [m]."""
    y_m: tuple[Coordinate, Coordinate] = (-1.5, 1.5)
    """Lowest and highest y of the floor in the world frame [m]."""


class TagsSpec(Spec):
    """Family and sizes of the AprilTags on the units; a size is the edge of the black square.

    Prints of all families are of one size, so that they fit the unit, unless sizes are given.
    """

    family: FamilyName = "tag36h11"
    """AprilTag family of every tag, those on obstacles included."""
    top_m: Size = 0.12
    """Edge of the tag on top of a unit [m]."""
    side_m: Size = 0.05
    """Edge of the left and the right tag of a port [m]."""
    mast_m: Size = 0.04
    """Edge of the middle tag of a port, on the mast [m]."""

    @model_validator(mode="before")
    @classmethod
    def _prints_of_one_size(cls, values: Any) -> Any:
        """Fill in the sizes that are not given, of a family that is not the default one."""
        family = values.get("family") if isinstance(values, dict) else None
        if not isinstance(family, str) or family not in FAMILIES or family == TAG36H11.name:
            return values
        share = TAG36H11.plate_ratio / FAMILIES[family].plate_ratio
        sizes = {key: share * cls.model_fields[key].default for key in ("top_m", "side_m", "mast_m")}
        return {**sizes, **values}

    @property
    def tag_family(self) -> TagFamily:
        """What is known of the family."""
        return FAMILIES[self.family]

    def size(self, slot: str) -> float:
        """Return the edge [m] of the black square of the tag on link ``slot``."""
        if slot == "tag_top":
            return self.top_m
        return self.mast_m if _MAST.fullmatch(slot) else self.side_m


class MarkerSpec(Spec):
    """The marker of a port as it was measured, in the place of its drawing.

    A scene file may write the name of the map's file alone: ``rear: marker.yaml``.
    """

    map: TagMapSpec
    """Map of its tags, as ``msrr map`` writes it; a scene file names the file, relative to its own folder."""
    anchor: Annotated[str, Field(min_length=1, max_length=255)] = "middle"
    """Tag of the marker that is where the URDF has it, so that it says where the map is on the unit: the end
    of the name of its link."""
    dock: MountSpec | None = None
    """Dock frame D of the port, seen from the map's reference tag with x into the tag, y left and z up as one
    sees it, for a port without tags in the URDF: it then has all tags of the map.

    D has its origin on the floor below the face of the port, x into the unit and z up: ``z_m`` is minus the
    height of the reference tag above the floor.
    """

    def frames(self, port: str) -> FrameMap:
        """Return the frames of the tags of a port that has none in the URDF; none if it has them."""
        if self.dock is None:
            return ()
        X_PD = SE3.from_xyz_rpy([0.0, 0.0, 0.0], [0.0, 0.0, math.pi])
        poses = {tag: X_PD @ X_DT for tag, X_DT in tags_in_dock(self.map, self.dock).items()}
        return tuple(
            MappedFrame(f"port_{port}_marker_{tag}", f"port_{port}", _triple(X.p), _triple(X.rpy()))
            for tag, X in poses.items()
        )


def tags_in_dock(tag_map: TagMapSpec, dock: MountSpec, tags: Collection[int] | None = None) -> dict[int, SE3]:
    """Return the poses ``X_DT`` of the tags of a map, by id.

    Args:
        tag_map: The map.
        dock: Dock frame D, seen from the reference tag of the map: x into the tag, y left, z up.
        tags: Ids of the tags; None for all.
    """
    X_MD = body_pose(SE3()) @ dock.X  # a tag has the axes of an optical frame
    chosen = tag_map.tags if tags is None else tags
    return {tag: X_MD.inverse() @ tag_map.tags[tag].X_MT for tag in chosen}


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


class UnitSpec(Spec):
    """One unit."""

    number: int = Field(ge=0, le=MAX_UNITS - 1)
    """Number n of the unit: its tags have the ids from 10 n on, that on top first, then those of the ports.

    Of the shipped unit, tag 10 n is on top, 10 n + 1 .. 10 n + 3 are the left, the middle and the right tag
    of the port ``rear``, 10 n + 4 .. 10 n + 6 those of ``left`` and 10 n + 7 .. 10 n + 9 those of ``right``.
    Other robots have their ports in the order of their frames; one without ``tag_top`` begins with a port.
    """
    urdf: FileName = "unit.urdf"
    """File name of the URDF: beside the scene file, in the working folder, or a shipped one."""
    frames: dict[LinkName, FrameSpec] = Field(default_factory=dict, max_length=MOST_FRAMES)
    """Links of the URDF that have other names than those of this project, or frames that it lacks, by the
    name of the frame: ``{axle: base_link, camera: {link: base_link, x_m: 0.1, z_m: 0.2}}``."""
    pose: PoseSpec = PoseSpec()
    """Start pose."""
    tag_ids: dict[str, TagId] = Field(default_factory=dict, max_length=MOST_TAGS)
    """Tag ids that differ from those of the number, by link name."""
    tag_sizes_m: dict[str, Size] = Field(default_factory=dict, max_length=MOST_TAGS)
    """Edges of tags that differ from those of ``tags`` [m], by link name."""
    markers: dict[Name, MarkerSpec] = Field(default_factory=dict, max_length=TAGS_PER_UNIT)
    """Markers of ports whose tags are where a map has them instead of the URDF, by port; everybody knows."""

    @property
    def frame_map(self) -> FrameMap:
        """Frames that are not links of the URDF under the same name, those of mapped tags last."""
        named = tuple(frame.mapped(name) for name, frame in self.frames.items())
        return sum((marker.frames(port) for port, marker in self.markers.items()), named)

    def mapped_tag_ids(self) -> dict[str, int]:
        """Return the ids of tags that only a map knows, by link name."""
        slots = ((frame.name, port) for port, m in self.markers.items() for frame in m.frames(port))
        return {slot: int(slot.removeprefix(f"port_{port}_marker_")) for slot, port in slots}

    def tag_size(self, slot: str, tags: TagsSpec) -> float:
        """Return the edge [m] of the black square of the tag on link ``slot``."""
        if slot in self.tag_sizes_m:
            return self.tag_sizes_m[slot]
        port, marker, _ = slot.removeprefix("port_").partition("_marker_")
        mapped = self.markers.get(port) if marker else None
        return tags.size(slot) if mapped is None else mapped.map.tag_size_m


class _Obstacle(Spec):
    height_m: Size = 0.15
    """Height of the obstacle [m]."""
    pose: PoseSpec = PoseSpec()
    """Start pose of the middle of the base."""
    tag_id: TagId | None = None
    """Id of the tag on the lid; without one the overhead camera cannot find the obstacle."""
    tag_m: Size = 0.10
    """Edge of the black square of the tag on the lid [m]."""
    appears_at_s: Time = 0.0
    """Time at which the obstacle appears [s]."""

    def _solid(self, kind: str, *size: float) -> Solid:
        return Solid("", kind, SE3(p=np.array([0.0, 0.0, 0.5 * self.height_m])), size)


class CylinderSpec(_Obstacle):
    """An upright cylinder, fixed to the floor."""

    shape: Literal["cylinder"]
    """Kind of obstacle."""
    radius_m: Size
    """Radius of the cylinder [m]."""

    @property
    def solid(self) -> Solid:
        """The shape in frame B, whose origin is the middle of the base."""
        return self._solid("cylinder", self.radius_m, self.height_m)


class BoxSpec(_Obstacle):
    """A box, fixed to the floor."""

    shape: Literal["box"]
    """Kind of obstacle."""
    length_m: Size
    """Edge along x of the box [m]."""
    width_m: Size
    """Edge along y of the box [m]."""

    @property
    def solid(self) -> Solid:
        """The shape in frame B, whose origin is the middle of the base."""
        return self._solid("box", self.length_m, self.width_m, self.height_m)

    @property
    def radius_m(self) -> float:
        """Radius of the circle about the footprint [m]."""
        return 0.5 * float((self.length_m**2 + self.width_m**2) ** 0.5)


ObstacleSpec = Annotated[CylinderSpec | BoxSpec, Field(discriminator="shape")]
