"""The known geometry of the arena: the overhead camera, and the tags on top of units and obstacles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from types import MappingProxyType

import numpy as np

from msrr_perception.pose.corner_errors import CornerErrors
from msrr_perception.pose.global_pose import FlatTag, GlobalLocalizer, flat_tags, overhead_pose
from msrr_perception.pose.overhead_errors import OverheadErrors, PoseErrors
from msrr_perception.pose.tone import straight_tone
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.rolling_shutter import RollingShutter
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import GlobalPose, Pixels
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.tag_families import TAG36H11, TagFamily
from msrr_scenes.specs.vehicle import LimitsSpec


@dataclass(frozen=True, eq=False)
class OverheadModel:
    """Calibration of the overhead camera and the catalogue of tags.

    It holds where a tag is on its body, and never where a body stands.

    Attributes:
        lens: Intrinsics of the overhead camera, by calibration.
        shutter: When the camera exposes the rows of a frame, by data sheet.
        X_WC: Pose of the camera, by calibration.
        tags: Tag id -> the body that carries the tag, and the tag's corners in that body's frame.
        obstacle_radius: Obstacle -> radius of the circle about its footprint [m]; also of those that appear
            later.
        units: Names of all units.
        corner_errors: Errors of the corners of tags, by data sheet of the camera.
        limits: Limits of the drive of all units, by data sheet.
        noise: Covariance, shape (3, 3) [m, rad], of global localisation beyond the camera's noise, by data
            sheet.
        errors: Errors of calibration of the camera and the tags, by their tolerances.
        to_light: Grey level of every pixel value on a straight tone curve, shape (256,); None if the camera
            has one.
        tag_family: Family of the tags.
    """

    lens: Lens
    shutter: RollingShutter
    X_WC: SE3
    tags: Mapping[int, FlatTag]
    obstacle_radius: Mapping[str, float]
    units: tuple[str, ...]
    corner_errors: CornerErrors
    limits: LimitsSpec
    noise: Array
    errors: OverheadErrors
    to_light: Pixels | None = None
    tag_family: TagFamily = TAG36H11

    @classmethod
    def from_scene(cls, scene: Scene, needed: Iterable[str]) -> OverheadModel:
        """Build from calibration and data sheets for a camera that has to find some units; no pose is read.

        Raises:
            SceneError: The scene has no overhead camera, or a unit that it has to find has no tag on top.
        """
        spec = scene.cameras.overhead
        if spec is None:
            raise SceneError("cameras.overhead: this scene has no overhead camera")
        tags = flat_tags(scene)
        seen = {tag.name for tag in tags.values()}
        for unit in needed:
            if unit not in seen:
                raise SceneError(f"units.{unit}: the overhead camera cannot find it, its URDF has no tag_top")
        errors = spec.localisation
        yaw = math.radians(errors.noise_yaw_deg)
        lens, X_WC = spec.lens, overhead_pose(spec)
        heights = [tag.height for tag in tags.values() if tag.name in scene.units]
        return cls(
            lens=lens,
            shutter=spec.rolling_shutter,
            X_WC=X_WC,
            tags=MappingProxyType(tags),
            obstacle_radius=MappingProxyType(
                {name: o.radius_m for name, o in scene.obstacles.items() if name in seen}
            ),
            units=tuple(scene.units),
            corner_errors=CornerErrors.from_spec(spec),
            limits=scene.limits,
            noise=np.diag([errors.noise_m**2, errors.noise_m**2, yaw**2]),
            errors=OverheadErrors(lens.camera, X_WC, scene.as_built, float(np.mean(heights or [0.0]))),
            to_light=straight_tone(spec),
            tag_family=scene.tags.tag_family,
        )

    @property
    def camera(self) -> PinholeCamera:
        """The ideal camera, in the image of which detections are given."""
        return self.lens.camera

    def errors_of(self, pose: GlobalPose) -> PoseErrors | None:
        """Return the errors of calibration of a measured pose; None if all is as designed."""
        return self.errors.of(self.tags[self.tag_of[pose.name]], pose.X_WB)

    def camera_effects(self, pose: GlobalPose) -> Array:
        """Return what one standard deviation of each error of the camera does to a pose, shape (3, 10)."""
        return self.errors.by_camera(self.tags[self.tag_of[pose.name]], pose.X_WB)

    def covariance_between(self, body: GlobalPose, other: GlobalPose) -> Array:
        """Return how well a body is known against another one near it, which is taken to be where it is seen.

        Errors of the camera do nearly the same to both, so that only the difference counts.

        Returns:
            Covariance of (x, y, yaw) of the body in W, shape (3, 3) [m, rad].
        """
        by_other = moved_along(other, body.X_WB)
        by_camera = self.camera_effects(body) - by_other @ self.camera_effects(other)
        covariance: Array = body.relative + by_other @ other.relative @ by_other.T + by_camera @ by_camera.T
        return covariance

    def roof(self, unit: str) -> Array:
        """Return standard deviations of the place of the tag on the roof: x, y [m], yaw [rad] in U, (3,)."""
        return self.errors.roof(self.tags[self.tag_of[unit]])

    def place_sigma(self, unit: str, box: tuple[float, float, float, float]) -> tuple[float, float]:
        """Return how far off a unit may be seen at the border of a box, where that is worst.

        Errors of calibration shift a unit the more the farther it is from below the camera: the corners of
        the box say how much. The bounds of ``box`` are x low, x high, y low, y high [m].

        Returns:
            Standard deviations of its place in W along x and y [m], by the tolerances of camera and tag.
        """
        variances = np.zeros(2)
        for x, y in product(box[:2], box[2:]):
            errors = self.errors.of(self.tags[self.tag_of[unit]], SE2(x, y, 0.0))
            if errors is not None:
                variances = np.maximum(variances, np.diag(errors.own + errors.shared)[:2])
        along_x, along_y = np.sqrt(variances).tolist()
        return along_x, along_y

    @cached_property
    def tag_of(self) -> Mapping[str, int]:
        """Body -> id of the tag on top of it."""
        return MappingProxyType({tag.name: tag_id for tag_id, tag in self.tags.items()})

    def square(self, middle_W: Array, half_m: float, unit: str) -> Window:
        """Return the window, in the frame or not, of a square at the height of a unit's tag.

        The square has its middle at ``middle_W``, shape (2,), and half its edge is ``half_m`` [m].
        """
        height = self.tags[self.tag_of[unit]].height
        corners = np.array([[x, y, height] for x in (-half_m, half_m) for y in (-half_m, half_m)])
        corners[:, :2] += middle_W
        ideal = self.camera.project(self.X_WC.inverse().act(corners))
        if self.lens.distorts:  # beyond what the frame shows the lens may lead anywhere
            shown = self.lens.bounds
            ideal = np.clip(ideal, [shown.x, shown.y], [shown.x_end, shown.y_end])
        return Window.around(self.lens.distorted(ideal), 0.0)

    def localizer(self) -> GlobalLocalizer:
        """Return the localizer for this camera's detections."""
        return GlobalLocalizer(
            self.lens, self.shutter, self.X_WC, self.tags, self.corner_errors, self.errors.strain
        )


def moved_along(body: GlobalPose, X_WU: SE2) -> Array:
    """Return the derivatives, shape (3, 3), by the pose of a body of a pose that moves along with it."""
    x, y = X_WU.x - body.X_WB.x, X_WU.y - body.X_WB.y
    return np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
