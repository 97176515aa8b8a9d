"""What errors of calibration do to the poses of bodies that an overhead camera measures, to first order.

Errors of the camera move the poses of all bodies alike, or nearly so: those of two bodies that are near each
other err together, and their distance is known far better than their places. The error of its tag is a body's
own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_perception.pose.global_pose import FlatTag
from msrr_perception.pose.tolerances import mount_sigmas
from msrr_scenes.arrays import Array, frozen
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.specs.as_built import AsBuiltSpec

#: Place on the plane of the roof, x, y and yaw, among the errors of a tag's mount.
_ON_ROOF = [0, 1, 5]

#: Distance over which the strain is computed [m].
_STRAIN_STEP_M = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PoseErrors:
    """Covariances of the errors of a measured pose that calibration is to blame for.

    Attributes:
        own: Covariance, shape (3, 3) [m, rad], of the error of this body alone.
        shared: Covariance, shape (3, 3) [m, rad], of the error that bodies near it have as well.
        held: Part of ``own`` by where the tag is held on the plane of the body's roof, shape (3, 3).
    """

    own: Array
    shared: Array
    held: Array


class OverheadErrors:
    """Errors of the poses that a camera looking straight down measures, by its tolerances.

    Attributes:
        strain: Standard deviation of the error of the distance of two bodies over that distance: the largest
            of all places in the frame.
        clock_s: Standard deviation of the time by which the clock of the camera is ahead [s].
    """

    def __init__(self, camera: PinholeCamera, X_WC: SE3, told: AsBuiltSpec, height: float) -> None:
        """Take tolerances; true errors are not looked at.

        The pose of the camera has image right along world x, and image up along y. Errors are shared at
        ``height``, that of the tags of units above the floor [m].
        """
        self._focal, self._foot, self._above = camera.focal, X_WC.p[:2], float(X_WC.p[2])
        self._height = height
        spec = told.overhead
        # The frame of the camera's mount has x down, y to the left of the image, and z up in the image.
        mount = mount_sigmas(spec)
        self._sigmas = np.array(
            [
                *(mount[i] for i in (1, 2, 0, 4, 5, 3)),
                *(0.01 * spec.focal_percent.sigma, spec.cx_px.sigma, spec.cy_px.sigma, spec.k1.sigma),
            ]
        )
        self._tag = np.array(mount_sigmas(told.tags))
        self.clock_s = 1e-3 * spec.clock_ms.sigma
        size = np.array([camera.width, camera.height]) / (2.0 * camera.focal) * self._above
        self.strain = self._largest_strain(size) if self._sigmas.any() else 0.0

    def of(self, tag: FlatTag, X_WB: SE2) -> PoseErrors | None:
        """Return the errors of the pose of a body; None if all is as designed."""
        if not (self._sigmas.any() or self._tag.any()):
            return None
        q, d, offset = self._seen_at(tag, X_WB)
        by_camera = _of_origin(self._by_camera(q, d), offset)
        beyond = by_camera - _of_origin(self._by_camera(q, self._above - self._height), offset)
        by_tag = _of_origin(self._by_tag(tag, X_WB.yaw, q, d), offset)
        held = by_tag[:, _ON_ROOF] @ by_tag[:, _ON_ROOF].T
        own = by_tag @ by_tag.T + beyond @ beyond.T
        return PoseErrors(own, frozen(by_camera @ by_camera.T), held)

    def by_camera(self, tag: FlatTag, X_WB: SE2) -> Array:
        """Return what one standard deviation of each error of the camera does to a pose, in W, shape (3, 10).

        The columns for two bodies stand for the same errors, so that their difference is what these do to the
        pose of the one against the other. What the height of a tag does beyond this is in ``own`` of
        :class:`PoseErrors`.
        """
        q, _, offset = self._seen_at(tag, X_WB)
        return _of_origin(self._by_camera(q, self._above - self._height), offset)

    def _seen_at(self, tag: FlatTag, X_WB: SE2) -> tuple[Array, float, Array]:
        """Return a tag from the foot of the camera, its depth, and it from its body's origin, in W [m]."""
        at = X_WB.act(tag.corners_B[:, :2].mean(axis=0))
        return at - self._foot, self._above - tag.height, at - X_WB.translation

    def roof(self, tag: FlatTag) -> Array:
        """Return standard deviations of where a tag is held on its roof: x, y [m], yaw [rad] in B, (3,)."""
        errors = self.of(tag, SE2())
        return np.zeros(3) if errors is None else np.sqrt(np.diag(errors.held))

    def _by_camera(self, q: Array, d: float) -> Array:
        """Return what one standard deviation of each error of the camera does to a pose, shape (3, 10).

        They are place, angles, focal length, principal point and k1. It follows from where the ray of a point
        at ``q`` meets its plane by what was told. The error of the yaw is half the curl of that field.

        Args:
            q: Place of the tag from the foot of the camera, shape (2,) [m].
            d: Distance of its plane from the camera [m].
        """
        x, y = q.tolist()
        c, r2 = d / self._focal, (x * x + y * y) / d**2
        by_x = [-1.0, 0.0, -x / d, -x * y / d, d + x * x / d, y, x, c, 0.0, x * r2]
        by_y = [0.0, -1.0, -y / d, -d - y * y / d, x * y / d, -x, y, 0.0, -c, y * r2]
        yaw = [0.0, 0.0, 0.0, 0.5 * x / d, 0.5 * y / d, -1.0, 0.0, 0.0, 0.0, 0.0]
        effects: Array = np.array([by_x, by_y, yaw]) * self._sigmas
        return effects

    def _by_tag(self, tag: FlatTag, yaw: float, q: Array, d: float) -> Array:
        """Return what one standard deviation of each error of a tag's mount does to a pose, shape (3, 6).

        A tag that leans is seen sheared where the camera does not look straight down on it.
        """
        right_B = tag.corners_B[1, :2] - tag.corners_B[0, :2]
        turned = yaw + math.atan2(right_B[1], right_B[0])
        c, s = math.cos(turned), math.sin(turned)
        x, y = (q / (2.0 * d)).tolist()
        by_x = [c, s, 2.0 * x, 0.0, 0.0, 0.0]
        by_y = [s, -c, 2.0 * y, 0.0, 0.0, 0.0]
        by_yaw = [0.0, 0.0, 0.0, y * s + x * c, y * c - x * s, 1.0]
        effects: Array = np.array([by_x, by_y, by_yaw]) * self._tag
        return effects

    def _largest_strain(self, half_frame: Array) -> float:
        """Return the largest strain at the middle, edges and corners of the frame, but for its rotation."""
        d, largest = self._above - self._height, 0.0
        for at in (half_frame * share for share in ((0, 0), (1, 0), (0, 1), (1, 1))):
            for way in np.eye(2):
                ends = [self._by_camera(at + sign * _STRAIN_STEP_M * way, d)[:2] for sign in (-0.5, 0.5)]
                along = way @ (ends[1] - ends[0]) / _STRAIN_STEP_M
                largest = max(largest, float(np.linalg.norm(along)))
        return largest


def _of_origin(effects: Array, offset: Array) -> Array:
    """Return effects on the pose of a body, given those on the pose of its tag.

    Args:
        effects: Effects on place and yaw of the tag, shape (3, N).
        offset: Tag from the origin of the body, in W, shape (2,) [m].
    """
    moved = effects.copy()
    moved[0] += effects[2] * offset[1]
    moved[1] -= effects[2] * offset[0]
    return moved
