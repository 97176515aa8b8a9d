"""Poses of units and obstacles in the world from overhead detections: pixel rays cut with a plane."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from msrr_perception.kernels.section_errors import surplus
from msrr_perception.pose.corner_errors import CornerErrors, corners_by_sections
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.rolling_shutter import RollingShutter
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.messages import NS_PER_S, Detections, GlobalPose, TagDetection
from msrr_scenes.specs.bodies import TAG_PLATE_M
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import OverheadCameraSpec

#: Root mean square distance of the corners from the fitted tag above which a detection is rejected, for it is
#: not this tag at this height: by a camera as calibrated [px], and in standard deviations of its strain.
_MISFIT_PX, _MISFIT_STRAINS = 2.0, 3.0

#: An obstacle's tag lies flat on its top: image right is the body's x, image up its y.
_R_FLAT_TAG: Array = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class FlatTag:
    """A level tag on top of a body.

    Attributes:
        name: Unit or obstacle that carries the tag.
        corners_B: Corners in the body frame B (z = 0 is the floor), shape (4, 3) [m]; all of one height.
    """

    name: str
    corners_B: Array

    @cached_property
    def height(self) -> float:
        """Height above the floor [m]."""
        return float(self.corners_B[:, 2].mean())

    def edge_px(self, camera: PinholeCamera, X_WC: SE3) -> float:
        """Return the length of the tag's edge in the ideal image of a camera above, wherever it is [px]."""
        edge_m = float(np.linalg.norm(self.corners_B[1] - self.corners_B[0]))
        return camera.focal * edge_m / (float(X_WC.p[2]) - self.height)


def overhead_pose(spec: OverheadCameraSpec) -> SE3:
    """Return X_WC of the overhead camera: straight down, image right along world x, image down along -y."""
    return SE3(np.diag([1.0, -1.0, -1.0]), np.array([spec.x_m, spec.y_m, spec.height_m]))


def rays_to_plane(camera: PinholeCamera, X_WC: SE3, pixels: Array, height: float) -> Array:
    """Return the points where pixel rays meet the plane z = ``height`` of W.

    Args:
        camera: Intrinsics of the camera.
        X_WC: Pose of the camera.
        pixels: Pixels, shape (N, 2).
        height: Height of the plane [m].

    Returns:
        Points in W, shape (N, 2) [m].

    Raises:
        SceneError: A ray does not meet the plane in front of the camera.
    """
    d = camera.rays(pixels) @ X_WC.R.T
    return X_WC.p[:2] + _range(X_WC, d, height)[:, None] * d[:, :2]


def rays_to_plane_jacobian(camera: PinholeCamera, X_WC: SE3, pixels: Array, height: float) -> Array:
    """Return the derivatives of :func:`rays_to_plane` by the pixel, shape (N, 2, 2) [m/px].

    Raises:
        SceneError: A ray does not meet the plane in front of the camera.
    """
    d = camera.rays(pixels) @ X_WC.R.T
    t = _range(X_WC, d, height)
    # The ray turns by the rotation's first two columns over f, sliding along the plane.
    turn = X_WC.R[:, :2] / camera.focal
    by_pixel: Array = t[:, None, None] * (turn[:2] - d[:, :2, None] * (turn[2] / d[:, 2:3])[:, None, :])
    return by_pixel


def _range(X_WC: SE3, directions: Array, height: float) -> Array:
    """Return the multiples of directions in W, shape (N, 3), at which rays of the camera meet a plane."""
    t: Array = (height - X_WC.p[2]) / directions[:, 2]
    if not np.all(np.isfinite(t)) or float(t.min()) <= 0.0:
        raise SceneError(f"the camera does not look at the plane z = {height} m")
    return t


def flat_tags(scene: Scene) -> dict[int, FlatTag]:
    """Return tag id -> flat tag of every unit and tagged obstacle, also of those that appear later."""
    tags = {}
    for unit in scene.units:
        geometry = scene.geometry(unit)
        if "tag_top" in geometry.tag_slots:
            corners = geometry.frame("tag_top").act(tag_corners(scene.tag_size(unit, "tag_top")))
            tags[scene.tag_ids(unit)["tag_top"]] = FlatTag(unit, corners)
    for name, obstacle in scene.obstacles.items():
        if obstacle.tag_id is not None:
            X_BT = SE3(_R_FLAT_TAG, np.array([0.0, 0.0, obstacle.height_m + TAG_PLATE_M]))
            tags[obstacle.tag_id] = FlatTag(name, X_BT.act(tag_corners(obstacle.tag_m)))
    return tags


class GlobalLocalizer:
    """Locates bodies by their top tags in overhead detections."""

    def __init__(
        self,
        lens: Lens,
        shutter: RollingShutter,
        X_WC: SE3,
        tags: Mapping[int, FlatTag],
        errors: CornerErrors,
        strain: float = 0.0,
    ) -> None:
        """Create a localizer.

        ``tags`` are by their ids. ``strain`` is the standard deviation of the relative error of a length as
        the camera shows it, by its tolerances.
        """
        self.camera = camera = lens.camera
        self._lens, self._shutter = lens, shutter
        self._strain = strain
        self.X_WC = X_WC
        self._X_CW = X_WC.inverse()
        self.tags = MappingProxyType(dict(tags))
        self._covariance_B: dict[str, Array] = {}
        self._modelled: dict[str, float] = {}  # variance of a corner's coordinate [px^2]
        lasting_share = {}
        for tag in self.tags.values():
            edge_px = tag.edge_px(camera, X_WC)
            lasting = errors.lasting_px(edge_px) ** 2
            variance = errors.frame_px(edge_px) ** 2 + lasting
            self._covariance_B[tag.name] = variance * self._by_sections(tag)
            self._modelled[tag.name] = errors.corner_variance(edge_px)
            lasting_share[tag.name] = lasting / variance
        #: Body -> share of the covariance of its error that stays the same while the body stands.
        self.lasting_share: Mapping[str, float] = MappingProxyType(lasting_share)

    def locate(self, detections: Detections) -> tuple[GlobalPose, ...]:
        """Return the pose of every known body among the detections, in the order of the tags.

        Each has the mean of the times at which the rows of its corners were exposed. Between these a body
        drives on, which turns its measured heading by 1.5 mrad at 0.3 m/s and 30 ms from the top row of the
        frame to the bottom row; that is not corrected.
        """
        found = (
            self._locate(tag, self.tags[tag.tag_id], detections.exposure.stamp_ns)
            for tag in detections.tags
            if tag.tag_id in self.tags
        )
        return tuple(pose for pose in found if pose is not None)

    def pixels(self, tag: FlatTag, X_WB: SE2) -> Array:
        """Return the pixels of a tag's corners, shape (4, 2), when its body stands at ``X_WB``."""
        p_W = SE3.from_se2(X_WB).act(tag.corners_B)
        return self.camera.project(self._X_CW.act(p_W))

    def _locate(self, seen: TagDetection, tag: FlatTag, stamp_ns: int) -> GlobalPose | None:
        points = rays_to_plane(self.camera, self.X_WC, seen.corners, tag.height)
        X_WB = fit_se2(tag.corners_B[:, :2], points)
        misfit = self.pixels(tag, X_WB) - seen.corners
        strained = _MISFIT_STRAINS * self._strain * (seen.corners - seen.corners.mean(axis=0))
        if float((misfit**2).sum()) > 4.0 * _MISFIT_PX**2 + float((strained**2).sum()):
            return None
        covariance = X_WB.rotate_covariance(self._covariance_B[tag.name])
        if seen.corner_sigma_px is not None:
            modelled = self._modelled[tag.name]
            more = sum(surplus(sigma**2, modelled) for sigma in seen.corner_sigma_px.tolist()) / 4.0
            if more > 0.0:
                covariance *= 1.0 + more / modelled
        after = float(self._shutter.after_stamp_ideal(self._lens, seen.corners).mean())
        stamp_ns += round(after * NS_PER_S)
        return GlobalPose(tag.name, stamp_ns, X_WB, 0.5 * (covariance + covariance.T))

    def _by_sections(self, tag: FlatTag) -> Array:
        """Return the covariance (3, 3) of (x, y, yaw) in B by that of a cross section [m, rad by px].

        It is that of a body below the camera, which looks down on level tags: so it is the same everywhere.
        """
        X_WB = SE2(float(self.X_WC.p[0]), float(self.X_WC.p[1]), 0.0)
        corners = self.pixels(tag, X_WB)
        by_pixel = rays_to_plane_jacobian(self.camera, self.X_WC, corners, tag.height)
        moved = (by_pixel @ corners_by_sections(corners).reshape(4, 2, 8)).reshape(8, 8)
        # Both sides are linear near the solution: the pose's covariance follows from the corners'.
        A = pose_jacobian(X_WB, tag.corners_B[:, :2])
        gain = np.linalg.solve(A.T @ A, A.T @ moved)
        covariance: Array = gain @ gain.T
        return covariance


def fit_se2(points_B: Array, points_A: Array) -> SE2:
    """Return the X_AB that maps ``points_B`` onto ``points_A``, both (N, 2), with the least squared error.

    Source: Umeyama, "Least-squares estimation of transformation parameters", PAMI 13, 1991; in the plane.
    """
    mean_B, mean_A = points_B.mean(axis=0), points_A.mean(axis=0)
    b, a = points_B - mean_B, points_A - mean_A
    yaw = math.atan2(float((b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0]).sum()), float((b * a).sum()))
    turned = SE2(0.0, 0.0, yaw).act(mean_B)
    return SE2(float(mean_A[0] - turned[0]), float(mean_A[1] - turned[1]), yaw)


def pose_jacobian(X_WB: SE2, points_B: Array) -> Array:
    """Return the derivatives of the points in W by (x, y, yaw), shape (2 N, 3)."""
    p = X_WB.act(points_B) - X_WB.translation
    A = np.zeros((2 * len(points_B), 3))
    A[0::2, 0] = A[1::2, 1] = 1.0
    A[0::2, 2], A[1::2, 2] = -p[:, 1], p[:, 0]
    return A
