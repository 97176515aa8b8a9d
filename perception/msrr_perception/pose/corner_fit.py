"""Least squares over tag corners with a Gaussian prior, by Gauss-Newton with Levenberg-Marquardt damping.

The joint pose (hardly any prior) and the filter's iterated update (the prediction as prior) are the same
problem: minimise r^T R^-1 r + (x - m)^T Lambda (x - m) for residuals r = pixels - h(x). The iterated extended
Kalman update equals this Gauss-Newton descent (Bell and Cathey, "The iterated Kalman filter update as a
Gauss-Newton method", IEEE TAC 38, 1993).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from msrr_perception.kernels.corners import MeasuredCorners, WeightedCorners
from msrr_perception.kernels.fit import fit
from msrr_perception.kernels.rates import AT_REST
from msrr_perception.pose.calibration import StateLayout
from msrr_perception.pose.target import YAW, TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.messages import TagDetection

#: Step at which the iteration stops, in standard deviations of the solution.
_TOLERANCE = 1e-3

#: Thickness of a set of corners, by its extent, below which they lie in one plane.
_FLAT = 0.1

#: Standard deviation below which the yaw by such corners is known, range beyond the solutions in which it is
#: cut into pieces otherwise, and their distance and standard deviation [rad]; number of linearisations.
_YAW_KNOWN, _YAW_RANGE, _YAW_PIECE, _YAW_ITERATIONS = 0.007, 0.5, 0.05, 12

#: Variance of the pose [m^2, rad^2] above which corners say nothing of it.
_LARGEST_VARIANCE = 1e6

#: Distance in standard deviations below which two poses count as one.
_SAME_SIGMAS = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class CornerFit:
    """The minimum that a fit found.

    Attributes:
        state: State, shape (n,); the first five entries are ``(x, y, yaw, pitch, roll)``.
        covariance: Inverse of the Gauss-Newton Hessian, shape (n, n).
        chi2: Squared residuals by their covariance, without the prior's part.
        cost: ``chi2`` plus the prior's part.
    """

    state: Array
    covariance: Array
    chi2: float
    cost: float


def deviation(state: Array, mean: Array) -> Array:
    """Return ``state - mean``, shape (n,), with the yaw wrapped."""
    d: Array = state - mean
    d[YAW] = math.remainder(d[YAW], 2.0 * math.pi)
    return d


def is_determined(fit: CornerFit) -> bool:
    """Return whether a fit says where the unit is, which corners in an order that no tag has do not."""
    if not (np.isfinite(fit.state).all() and np.isfinite(fit.covariance).all()):
        return False
    least, _, greatest = np.linalg.eigvalsh(fit.covariance[:3, :3]).tolist()
    return bool(least > 0.0 and greatest < _LARGEST_VARIANCE)


def is_same_pose(state: Array, mean: Array, covariance: Array) -> bool:
    """Return whether the pose of a state is that of another one, by the mean and the covariance of that."""
    off = deviation(state, mean)[:3]
    return float(off @ np.linalg.solve(covariance[:3, :3], off)) < _SAME_SIGMAS**2


def distinct(fits: Sequence[CornerFit]) -> list[CornerFit]:
    """Return those of one fit or more whose poses lie apart from those of better ones, best first."""
    found = list[CornerFit]()
    for one in sorted(fits, key=lambda one: one.cost):
        if not any(is_same_pose(one.state, other.state, other.covariance) for other in found):
            found.append(one)
    return found


def second_moment(state: Array, found: Sequence[CornerFit]) -> Array:
    """Return the second moment of one fit or more about a state, each by its odds, shape (n, n)."""
    off = [deviation(one.state, state) for one in found]
    moments = [one.covariance + np.outer(d, d) for one, d in zip(found, off, strict=True)]
    return np.asarray(np.tensordot(odds([one.cost for one in found]), np.array(moments), axes=1))


def odds(costs: Sequence[float]) -> Array:
    """Return the probability of each of some hypotheses by the squared residuals that it leaves."""
    likelihoods = np.exp(-0.5 * (np.array(costs) - min(costs)))
    return np.asarray(likelihoods / likelihoods.sum())


def are_in_one_plane(target: TargetModel, tags: Sequence[TagDetection]) -> bool:
    """Return whether tags of the target, one or more, lie in one plane, so that they leave the yaw open."""
    points = np.concatenate([target.corners_D[tag.tag_id] for tag in tags])
    widest, _, out_of_plane = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(out_of_plane < _FLAT * widest)


def pieces_along_yaw(
    target: TargetModel,
    layout: StateLayout,
    seen: WeightedCorners,
    solutions: Sequence[CornerFit],
    prior_mean: Array,
    prior_information: Array,
) -> list[CornerFit]:
    """Return fits to tags in one plane that together are as likely everywhere as the tags say, best first.

    Seen from the front, such tags determine the yaw so poorly that the likelihood is not Gaussian: it is flat
    or has two peaks, and its curvature at the best point is far too optimistic. So it is cut into pieces
    along the yaw: priors of the yaw, each of which is narrow enough for its fit to be linear, and which add
    up to a constant. ``solutions`` are those that :func:`fit_corners` found by the same prior, best first.
    """
    if len(solutions) == 1 and solutions[0].covariance[YAW, YAW] < _YAW_KNOWN**2:
        return list(solutions)
    best = solutions[0].state
    turns = [float(deviation(one.state, best)[YAW]) for one in solutions]
    mean, held = prior_mean.copy(), prior_information.copy()
    held[YAW, YAW] = _YAW_PIECE**-2
    start = solutions[int(np.argmin(turns))].state.copy()
    pieces = list[CornerFit]()
    for turn in np.arange(min(turns) - _YAW_RANGE, max(turns) + _YAW_RANGE, _YAW_PIECE):
        mean[YAW] = start[YAW] = best[YAW] + turn
        try:
            piece = fit_corners(target, layout, seen, start, mean, held, _YAW_ITERATIONS)
        except np.linalg.LinAlgError:  # at this yaw the corners explain nothing
            continue
        if math.isfinite(piece.cost) and is_determined(piece):
            # By Laplace's method a piece is as probable as it is high and wide.
            pieces.append(replace(piece, cost=piece.cost - float(np.linalg.slogdet(piece.covariance)[1])))
            start = piece.state.copy()
    return sorted(pieces, key=lambda piece: piece.cost) or list(solutions)


def measured_corners(target: TargetModel, tags: Sequence[TagDetection]) -> MeasuredCorners:
    """Return what is measured of tags of the target."""
    which = np.array([target.layout.index[t.tag_id] for t in tags], dtype=np.int64)
    corners = np.array([t.corners for t in tags], dtype=np.float64).reshape(-1, 4, 2)
    not_measured = np.zeros(4)
    sigmas = [not_measured if t.corner_sigma_px is None else t.corner_sigma_px for t in tags]
    after = target.shutter.after_stamp_ideal(target.lens, corners)
    return MeasuredCorners(which, corners.reshape(-1, 8), np.array(sigmas, dtype=np.float64), after)


def equally_weighted(target: TargetModel, tags: Sequence[TagDetection], sigma_px: float) -> WeightedCorners:
    """Return corners of a target that stands, all equally good, by ``sigma_px`` [px], and independent."""
    measured = measured_corners(target, tags)
    count = len(tags)
    roots = np.tile(sigma_px * np.eye(8), (count, 1, 1))
    return WeightedCorners(measured.which, measured.corners, measured.after, np.zeros(count), roots, AT_REST)


def fit_corners(
    target: TargetModel,
    layout: StateLayout,
    seen: WeightedCorners,
    start: Array,
    prior_mean: Array,
    prior_information: Array,
    max_iterations: int = 10,
) -> CornerFit:
    """Find the state that explains the corners best.

    Args:
        target: Camera and its mounting.
        layout: Layout of the state.
        seen: Measured corners.
        start: First guess, shape (n,); entries that are in no column of the layout do not affect the image.
        prior_mean: Mean m of the prior, shape (n,).
        prior_information: Information matrix Lambda of the prior, shape (n, n), positive semidefinite.
        max_iterations: Largest number of linearisations.

    Returns:
        The best state found, with the covariance about that state.

    Raises:
        numpy.linalg.LinAlgError: Corners and prior together do not fix every direction of the state.
    """
    state, covariance, chi2, cost, solvable = fit(
        target.optics, layout.tags, seen, start, prior_mean, prior_information, max_iterations, _TOLERANCE
    )
    if not solvable:
        raise np.linalg.LinAlgError("corners and prior leave a direction of the state open")
    return CornerFit(state, covariance, chi2, cost)
