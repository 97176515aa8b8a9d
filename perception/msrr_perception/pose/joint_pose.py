"""The joint relative pose over the corners of every visible tag, with covariance, started from one tag."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from msrr_perception.kernels.corners import Seen
from msrr_perception.pose.corner_fit import CornerFit, deviation, equally_good, fit_corners
from msrr_perception.pose.target import YAW, TargetModel, pose_vector
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import TagDetection

#: Range beyond the solutions and step in which a single tag's yaw is sampled, and the standard deviation with
#: which the yaw is held at a sample [rad].
_YAW_RANGE = 0.5
_YAW_STEP = 0.035
_YAW_HOLD = 1e-5

#: Variance of the pose [m^2, rad^2] above which corners say nothing of it.
_LARGEST_VARIANCE = 1e6

#: Distance in standard deviations below which two solutions count as one.
_SAME_SIGMAS = 0.5


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
        pitch: Most likely pitch [rad].
        roll: Most likely roll [rad].
        tilt_covariance: Covariance of (x, y, yaw, pitch, roll) about the chosen solution, shape (5, 5).
        chi2: Sum of the squared residuals over sigma^2, with 8 coordinates per tag.
        tags: Ids of the tags used.
        alternative: The other solution, where the tags allow two that lie apart.
        gap: Excess of the alternative's cost over the chosen one's; infinite without an alternative.
    """

    X_DU: SE2
    covariance: Array
    pitch: float
    roll: float
    tilt_covariance: Array
    chi2: float
    tags: tuple[int, ...]
    alternative: SE2 | None
    gap: float


def one_tag_poses(target: TargetModel, tag: TagDetection) -> tuple[SE2, ...]:
    """Return the one or two poses X_DU at which a single flat tag appears as detected, best first.

    Source: Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109, 2014 (IPPE), projected
    to the floor.
    """
    corners_D = target.corners_D[tag.tag_id]
    x, y = corners_D[1] - corners_D[0], corners_D[0] - corners_D[3]
    size = float(np.linalg.norm(x))
    X_DT = SE3(np.stack([x, y, np.cross(x, y) / size], axis=1) / size, corners_D.mean(axis=0))
    h = 0.5 * size
    square = np.array([[-h, h, 0.0], [h, h, 0.0], [h, -h, 0.0], [-h, -h, 0.0]])
    count, rotations, translations, _ = cv2.solvePnPGeneric(
        square, tag.corners, target.camera.matrix(), np.zeros(4), flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    poses = []
    for i in range(count):
        R = np.asarray(cv2.Rodrigues(rotations[i])[0], dtype=np.float64)
        X_CT = SE3(R, np.asarray(translations[i], dtype=np.float64))
        poses.append((X_DT @ X_CT.inverse() @ target.X_CU).to_se2())
    return tuple(poses)


def joint_pose(
    target: TargetModel, tags: Sequence[TagDetection], noise: CornerNoise = DEFAULT_CORNER_NOISE
) -> JointPose | None:
    """Estimate the relative pose from the corners of every tag of the target.

    Both poses of the tag that is largest in the image are refined over all corners of all tags, on the flat
    floor with pitch and roll as nuisances; the smaller cost wins.

    Args:
        target: Camera and map of the tags.
        tags: Detections; those of other units are ignored.
        noise: Assumed noise of corners and tilt.

    Returns:
        The pose, or None when no tag of the target is among ``tags`` or none gives a finite solution.
    """
    known = [t for t in tags if t.tag_id in target.corners_D]
    if not known:
        return None
    seen = equally_good(target.layout, known, noise.corner_sigma_px)
    largest = max(known, key=lambda t: (_area(t.corners), -t.tag_id))
    prior = np.zeros((5, 5))
    prior[3, 3] = prior[4, 4] = noise.tilt_sigma**-2
    fits = []
    for start in one_tag_poses(target, largest):
        vector = pose_vector(start)
        try:
            fit = fit_corners(target, target.layout, seen, vector, np.zeros(5), prior, max_iterations=40)
        except np.linalg.LinAlgError:  # there is no solution near this start; there may be one near the other
            continue
        if _is_determined(fit):
            fits.append(fit)
    if not fits:
        return None
    fits.sort(key=lambda f: f.cost)
    pose = _report(fits, tuple(sorted(t.tag_id for t in known)))
    if len(known) > 1 or (pose.alternative is None and pose.covariance[2, 2] < (0.2 * _YAW_STEP) ** 2):
        return pose
    spread = _covariance_along_yaw(target, seen, fits, prior)
    if spread is None:
        return None
    # Where the yaw is known better than a step of the sampling, the curvature is right and the sum is coarse.
    return pose if spread[2, 2] < _YAW_STEP**2 else replace(pose, covariance=spread)


def consistent_pose(
    target: TargetModel,
    tags: Sequence[TagDetection],
    noise: CornerNoise = DEFAULT_CORNER_NOISE,
    agree: Callable[[JointPose, Sequence[TagDetection]], bool] | None = None,
) -> JointPose | None:
    """Return the joint pose of tags that agree with each other, for a start without a prior.

    Of three tags or more the one that disagrees is left out; of two that disagree neither can be trusted.

    Args:
        target: Camera and map of the tags.
        tags: Detections; those of other units are ignored.
        noise: Assumed noise of corners and tilt.
        agree: Function that returns whether a pose explains its tags; None goes by its chi2.
    """
    known = [t for t in tags if t.tag_id in target.corners_D]

    def fits(some: Sequence[TagDetection], pose: JointPose) -> bool:
        return good_fit(pose.chi2, len(pose.tags)) if agree is None else agree(pose, some)

    pose = joint_pose(target, known, noise)
    if pose is None or fits(known, pose):
        return pose
    if len(known) < 3:
        return None
    best: JointPose | None = None
    for odd in known:
        rest = [t for t in known if t is not odd]
        found = joint_pose(target, rest, noise)
        if found is not None and fits(rest, found) and (best is None or found.chi2 < best.chi2):
            best = found
    return best


def good_fit(chi2: float, tags: int) -> bool:
    """Return whether the squared residuals of a pose are those of tags that agree.

    Args:
        chi2: Squared residuals of all corners by their covariance.
        tags: Number of tags.
    """
    # The bound is above twice the degrees of freedom because rendered corners are not quite independent.
    return chi2 <= 2.0 * (8 * tags - 3) + 12.0


def _is_determined(fit: CornerFit) -> bool:
    """Return whether a fit says where the unit is, which corners in an order that no tag has do not."""
    if not (np.isfinite(fit.state).all() and np.isfinite(fit.covariance).all()):
        return False
    least, _, greatest = np.linalg.eigvalsh(fit.covariance[:3, :3]).tolist()
    return bool(least > 0.0 and greatest < _LARGEST_VARIANCE)


def _report(fits: list[CornerFit], tags: tuple[int, ...]) -> JointPose:
    best = fits[0]
    covariance, alternative, gap = best.covariance[:3, :3], None, math.inf
    X_DU = SE2(*best.state[:3])
    for other in fits[1:]:
        d = other.state[:3] - best.state[:3]
        d[2] = math.remainder(d[2], 2.0 * math.pi)
        if float(d @ np.linalg.solve(covariance, d)) < _SAME_SIGMAS**2:
            continue
        alternative, gap = SE2(*other.state[:3]), other.cost - best.cost
        # Second moment of the two-peaked posterior about the better peak.
        w = 1.0 / (1.0 + math.exp(min(0.5 * gap, 500.0)))
        covariance = (1.0 - w) * covariance + w * (other.covariance[:3, :3] + np.outer(d, d))
    return JointPose(
        X_DU=X_DU,
        covariance=covariance,
        pitch=float(best.state[3]),
        roll=float(best.state[4]),
        tilt_covariance=best.covariance,
        chi2=best.chi2,
        tags=tags,
        alternative=alternative,
        gap=gap,
    )


def _covariance_along_yaw(
    target: TargetModel, seen: Seen, fits: Sequence[CornerFit], prior: Array
) -> Array | None:
    """Return the second moment of (x, y, yaw) about the first fit, shape (3, 3), summed over the yaw.

    A single flat tag seen from the front determines the yaw so poorly that the likelihood is not Gaussian: it
    is flat or has two peaks, and its curvature at the best point is far too optimistic. So the yaw is
    sampled, the other entries are solved for at each sample, and the moments are taken over all samples. None
    when there is a solution at no sample, as for corners that are not those of a tag.
    """
    best = fits[0].state
    turns = [math.remainder(float(f.state[YAW] - best[YAW]), 2.0 * math.pi) for f in fits]
    held = prior.copy()
    held[YAW, YAW] = _YAW_HOLD**-2
    costs, moments = [], []
    start = fits[int(np.argmin(turns))].state.copy()
    for turn in np.arange(min(turns) - _YAW_RANGE, max(turns) + _YAW_RANGE, _YAW_STEP):
        mean = np.zeros(5)
        mean[YAW] = start[YAW] = best[YAW] + turn
        try:
            fit = fit_corners(target, target.layout, seen, start, mean, held, max_iterations=8)
        except np.linalg.LinAlgError:  # at this yaw the corners explain nothing
            continue
        if not (math.isfinite(fit.cost) and np.isfinite(fit.covariance).all()):
            continue
        d = deviation(fit.state, best)[:3]
        costs.append(fit.cost)
        moments.append(fit.covariance[:3, :3] + np.outer(d, d))
        start = fit.state.copy()
    if not costs:
        return None
    weights = np.exp(-0.5 * (np.array(costs) - min(costs)))
    return np.asarray(np.tensordot(weights / weights.sum(), np.array(moments), axes=1))


def _area(corners: Array) -> float:
    (a, b, c, d) = corners
    p, q = c - a, d - b
    return 0.5 * abs(float(p[0] * q[1] - p[1] * q[0]))
