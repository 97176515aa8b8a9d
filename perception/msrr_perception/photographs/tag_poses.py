"""Both poses at which a flat tag appears as it was seen, each with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from msrr_perception.pose.square_poses import square_poses
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners

#: Standard deviation of each coordinate of a corner on a photograph [px]: measured against the alignment of
#: the whole pattern of 107 tags, 0.22 px. It holds for refined corners and for the library's alike. What the
#: image shows of an edge is less: it does not show that paper is not flat and lenses are not ideal.
CORNER_SIGMA_PX = 0.22

#: Most steps of Gauss and Newton, and the step at which they end [rad, and share of the distance].
_STEPS, _SETTLED = 100, 1e-10

#: Largest difference of the rotation matrices of two fits that ended at one pose.
_ONE_POSE = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class TagPose:
    """A pose of a tag.

    Attributes:
        X_CT: Pose of the tag T in the camera C: x of T points to the right of the tag, y down, z into it.
        reprojection_px: Root mean square of the eight residuals of the corners in the picture [px].
        misfit: Sum of the squares of these residuals over those of the corners' standard deviations; with
            such noise it has a chi-square distribution of two degrees of freedom.
        covariance: Of a small rotation about the axes of C [rad] and of the place in C [m], shape (6, 6), by
            the noise of the corners to first order.
    """

    X_CT: SE3
    reprojection_px: float
    misfit: float
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Corners:
    """The corners of a tag as they were seen.

    Attributes:
        camera: Ideal camera.
        ideal: Corners in its image, shape (4, 2) [px].
        points: Corners of the tag T, shape (4, 3) [m].
        slopes: Derivatives of pixels of the picture by those of the ideal image, shape (4, 2, 2) or (2, 2).
    """

    camera: PinholeCamera
    ideal: Array
    points: Array
    slopes: Array


def tag_poses(
    lens: Lens, corners: Array, size: float, sigma_px: Array | float = CORNER_SIGMA_PX
) -> tuple[TagPose, ...]:
    """Return the one or two poses of a tag, best first.

    Both poses of :func:`square_poses` are moved to their least squares in the picture, where the noise is.
    The covariance of a pose does not know of the other one. A tag that is small or seen from the front may be
    at either; the ratio of the reprojection errors says how sure the choice is. Where both starts lead to one
    pose, there is one.

    Args:
        lens: Lens of the picture.
        corners: Corners in the picture, shape (4, 2) [px], in the order of
            :class:`msrr_scenes.messages.TagDetection`.
        size: Edge of the black square [m].
        sigma_px: Standard deviation of each coordinate of a corner [px], one of all corners or shape (4,).
    """
    ideal = lens.undistorted(corners)
    slopes = lens.slopes(ideal) if lens.distorts else np.eye(2)
    seen = _Corners(lens.camera, ideal, tag_corners(size), slopes)
    fits = [_least_squares(seen, start, sigma_px) for start, _ in square_poses(lens.camera, ideal, size)]
    poses = [pose for pose in fits if pose is not None]
    poses.sort(key=lambda pose: pose.reprojection_px)
    return tuple(poses[:1] if len(poses) == 2 and _same(*poses) else poses)


def _same(a: TagPose, b: TagPose) -> bool:
    """Return whether both starts have led to one pose."""
    return bool(np.abs(a.X_CT.R - b.X_CT.R).max() < _ONE_POSE)


def _least_squares(seen: _Corners, start: SE3, sigma_px: Array | float) -> TagPose | None:
    """Return the pose of least squares near ``start``, or None if there is none."""
    R, t = start.R, start.p
    for _ in range(_STEPS):
        residuals, J = _residuals(seen, R, t)
        if not np.isfinite(J).all():
            return None
        step, *_rest = np.linalg.lstsq(J, residuals, rcond=None)
        R = np.asarray(cv2.Rodrigues(step[:3])[0], dtype=np.float64) @ R
        t = t + step[3:]
        if np.abs(step[:3]).max() < _SETTLED and np.abs(step[3:]).max() < _SETTLED * abs(t[2]):
            break
    residuals, J = _residuals(seen, R, t)
    if t[2] <= 0.0 or not np.isfinite(residuals).all() or np.linalg.matrix_rank(J) < J.shape[1]:
        return None
    sigma = np.repeat(np.broadcast_to(sigma_px, 4), 2)
    by_corners = np.linalg.solve(J.T @ J, J.T) * sigma
    covariance = by_corners @ by_corners.T
    return TagPose(
        X_CT=SE3(R, t),
        reprojection_px=float(np.sqrt((residuals**2).mean())),
        misfit=float(((residuals / sigma) ** 2).sum()),
        covariance=0.5 * (covariance + covariance.T),
    )


def _residuals(seen: _Corners, R: Array, t: Array) -> tuple[Array, Array]:
    """Return residuals in the picture, shape (8,), and derivatives by rotation about C and by place, (8, 6).

    The noise of the corners is that of the picture. Near its border a lens may show twice as much of the
    ideal image in a pixel, so that residuals there would count for too little.
    """
    turned = seen.points @ R.T
    p = turned + t
    residuals = seen.ideal - seen.camera.project(p)
    J = np.empty((4, 2, 6))
    f = seen.camera.focal / p[:, 2]
    for axis in (0, 1):
        by_p = np.zeros((4, 3))
        by_p[:, axis] = f
        by_p[:, 2] = -f * p[:, axis] / p[:, 2]
        J[:, axis, :3] = np.cross(turned, by_p)
        J[:, axis, 3:] = by_p
    return (seen.slopes @ residuals[..., np.newaxis]).ravel(), (seen.slopes @ J).reshape(8, 6)
