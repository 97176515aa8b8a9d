"""The joint relative pose over the corners of every visible tag, with covariance, started from one tag."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msrr_perception.pose.corner_fit import (
    CornerFit,
    are_in_one_plane,
    distinct,
    equally_weighted,
    fit_corners,
    is_determined,
    pieces_along_yaw,
    second_moment,
)
from msrr_perception.pose.square_poses import square_poses
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import TagDetection


@dataclass(frozen=True, slots=True)
class CornerNoise:
    """The assumed errors of measured corners and of the flat floor.

    Attributes:
        corner_sigma_px: Standard deviation of each corner coordinate [px]. Errors of corners on one straight
            edge are correlated, and from frame to frame too, so it exceeds the scatter within one tag.
        tilt_sigma: Standard deviation of the pitch and of the roll of one unit against the other [rad].
    """

    corner_sigma_px: float = 0.25
    tilt_sigma: float = math.radians(0.3)


#: The noise of rendered images with anti-aliasing.
DEFAULT_CORNER_NOISE = CornerNoise()


@dataclass(frozen=True, slots=True, eq=False)
class JointPose:
    """A relative pose from one exposure.

    Attributes:
        X_DU: Pose of the unit in the dock frame D of its target.
        covariance: Covariance of (x, y, yaw) in D, shape (3, 3) [m, rad], with pitch and roll marginalised;
            it covers both solutions where the tags allow two.
    """

    X_DU: SE2
    covariance: Array


def one_tag_poses(target: TargetModel, tag: TagDetection) -> tuple[SE2, ...]:
    """Return the poses X_DU on the floor at which a single flat tag appears as detected, best first."""
    corners_D = target.corners_D[tag.tag_id]
    x, y = corners_D[1] - corners_D[0], corners_D[0] - corners_D[3]
    size = float(np.linalg.norm(x))
    X_DT = SE3(np.stack([x, y, np.cross(x, y) / size], axis=1) / size, corners_D.mean(axis=0))
    found = square_poses(target.camera, tag.corners, size)
    return tuple((X_DT @ X_CT.inverse() @ target.X_CU).to_se2() for X_CT, _ in found)


def largest_tag(tags: Sequence[TagDetection]) -> TagDetection:
    """Return the tag that is largest in the image; of two the one with the lower id."""
    return max(tags, key=lambda tag: (_area(tag.corners), -tag.tag_id))


def _area(corners: Array) -> float:
    (a, b, c, d) = corners
    p, q = c - a, d - b
    return 0.5 * abs(float(p[0] * q[1] - p[1] * q[0]))


def joint_pose(
    target: TargetModel, tags: Sequence[TagDetection], noise: CornerNoise = DEFAULT_CORNER_NOISE
) -> JointPose | None:
    """Estimate the relative pose from the corners of every tag of the target; see :func:`joint_fits`.

    Tags of other units are ignored. It is None when no tag of the target is there or none gives a finite
    solution.
    """
    known = [t for t in tags if t.tag_id in target.corners_D]
    fits = joint_fits(target, known, noise) if known else []
    if not fits:
        return None
    best, pieces = fits[0].state, fits
    if are_in_one_plane(target, known):
        seen = equally_weighted(target, known, noise.corner_sigma_px)
        pieces = pieces_along_yaw(target, target.layout, seen, fits, np.zeros(5), _level(noise))
    return JointPose(SE2(*best[:3]), second_moment(best, pieces)[:3, :3])


def joint_fits(target: TargetModel, tags: Sequence[TagDetection], noise: CornerNoise) -> list[CornerFit]:
    """Return the poses with tilt, best first, at which tags of the target, one or more, appear as detected.

    Both poses of the tag that is largest in the image are refined over all corners of all tags, on the flat
    floor with pitch and roll as nuisances; there are two where they end apart.
    """
    seen, level = equally_weighted(target, tags, noise.corner_sigma_px), _level(noise)
    fits = list[CornerFit]()
    for start in one_tag_poses(target, largest_tag(tags)):
        vector = pose_vector(start)
        try:
            fit = fit_corners(target, target.layout, seen, vector, np.zeros(5), level, max_iterations=40)
        except np.linalg.LinAlgError:  # there is no solution near this start; there may be one near the other
            continue
        if is_determined(fit):
            fits.append(fit)
    return distinct(fits)


def _level(noise: CornerNoise) -> Array:
    """Return the information of the prior of a pose with tilt, shape (5, 5): both units stand level."""
    return np.diag([0.0, 0.0, 0.0, noise.tilt_sigma**-2, noise.tilt_sigma**-2])
