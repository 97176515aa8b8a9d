"""Least squares over tag corners with a Gaussian prior, by Gauss-Newton with Levenberg-Marquardt damping.

The joint pose (hardly any prior) and the filter's iterated update (the prediction as prior) are the same
problem: minimise r^T R^-1 r + (x - m)^T Lambda (x - m) for residuals r = pixels - h(x). The iterated extended
Kalman update equals this Gauss-Newton descent (Bell and Cathey, "The iterated Kalman filter update as a
Gauss-Newton method", IEEE TAC 38, 1993).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.calibrated import AT_REST
from msrr_perception.kernels.corners import Seen
from msrr_perception.kernels.fit import fit
from msrr_perception.pose.calibration import StateLayout
from msrr_perception.pose.target import YAW, TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.messages import TagDetection

#: Step at which the iteration stops, in standard deviations of the solution.
_TOLERANCE = 1e-3

#: Range beyond the solutions and step in which a single tag's yaw is sampled, and the standard deviation with
#: which the yaw is held at a sample [rad]; largest number of linearisations there.
_YAW_RANGE, _YAW_STEP, _YAW_HOLD, _YAW_ITERATIONS = 0.5, 0.035, 1e-5, 8

#: Variance of the pose [m^2, rad^2] above which corners say nothing of it.
_LARGEST_VARIANCE = 1e6

#: Distance in standard deviations below which two solutions count as one.
_SAME_SIGMAS = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class CornerFit:
    """The minimum that a fit found.

    Attributes:
        state: State, shape (n,); the first five entries are ``(x, y, yaw, pitch, roll)``.
        covariance: Inverse of the Gauss-Newton Hessian, shape (n, n).
        chi2: Squared residuals by their covariance, without the prior's part.
        cost: ``chi2`` plus the prior's part.
        converged: Whether the last step was below the tolerance.
    """

    state: Array
    covariance: Array
    chi2: float
    cost: float
    converged: bool


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


def distinct(fits: Sequence[CornerFit]) -> list[CornerFit]:
    """Return those of one fit or more whose poses lie apart from those of better ones, best first."""
    found = list[CornerFit]()
    for one in sorted(fits, key=lambda one: one.cost):
        off = [(deviation(one.state, other.state)[:3], other.covariance[:3, :3]) for other in found]
        if all(float(d @ np.linalg.solve(P, d)) >= _SAME_SIGMAS**2 for d, P in off):
            found.append(one)
    return found


def second_moment(solutions: Sequence[CornerFit]) -> Array:
    """Return the second moment of all solutions about the first, each by its odds, shape (n, n)."""
    return _moment_about(solutions[0].state, solutions)


def moment_along_yaw(
    target: TargetModel,
    layout: StateLayout,
    seen: Seen,
    solutions: Sequence[CornerFit],
    prior_mean: Array,
    prior_information: Array,
) -> Array:
    """Return the second moment about the first solution of a fit to a single tag, shape (n, n).

    A single flat tag seen from the front determines the yaw so poorly that the likelihood is not Gaussian: it
    is flat or has two peaks, and its curvature at the best point is far too optimistic. So the yaw is
    sampled, the other entries are solved for at each sample, and the moments are taken over all samples.

    Args:
        target: Camera and its mounting.
        layout: Layout of the state.
        seen: Measured corners.
        solutions: Solutions that lie apart, best first.
        prior_mean: As for :func:`fit_corners`, which found the solutions.
        prior_information: The same.
    """
    by_curvature = second_moment(solutions)
    if len(solutions) == 1 and by_curvature[YAW, YAW] < (0.2 * _YAW_STEP) ** 2:
        return by_curvature
    best = solutions[0].state
    turns = [float(deviation(one.state, best)[YAW]) for one in solutions]
    mean, held = prior_mean.copy(), prior_information.copy()
    held[YAW, YAW] = _YAW_HOLD**-2
    start = solutions[int(np.argmin(turns))].state.copy()
    samples = list[CornerFit]()
    for turn in np.arange(min(turns) - _YAW_RANGE, max(turns) + _YAW_RANGE, _YAW_STEP):
        mean[YAW] = start[YAW] = best[YAW] + turn
        try:
            sample = fit_corners(target, layout, seen, start, mean, held, _YAW_ITERATIONS)
        except np.linalg.LinAlgError:  # at this yaw the corners explain nothing
            continue
        if math.isfinite(sample.cost) and np.isfinite(sample.covariance).all():
            samples.append(sample)
            start = sample.state.copy()
    if not samples:
        return by_curvature
    along_yaw = _moment_about(best, samples)
    # Where the yaw is known better than a step of the sampling, the curvature is right and the sum is coarse.
    return by_curvature if along_yaw[YAW, YAW] < _YAW_STEP**2 else along_yaw


def _moment_about(state: Array, found: Sequence[CornerFit]) -> Array:
    """Return the second moment of fits about a state, each by its odds, shape (n, n)."""
    costs = np.array([one.cost for one in found])
    odds = np.exp(-0.5 * (costs - costs.min()))
    off = [deviation(one.state, state) for one in found]
    moments = [one.covariance + np.outer(d, d) for one, d in zip(found, off, strict=True)]
    return np.asarray(np.tensordot(odds / odds.sum(), np.array(moments), axes=1))


def measured_corners(
    layout: StateLayout, tags: Sequence[TagDetection]
) -> tuple[NDArray[np.int64], Array, Array]:
    """Return index, corners [px] and measured deviations [px] of K tags, shapes (K,), (K, 8) and (K, 4).

    Deviations of tags whose corners do not tell theirs are 0.
    """
    which = np.array([layout.index[t.tag_id] for t in tags], dtype=np.int64)
    corners = np.array([t.corners for t in tags], dtype=np.float64).reshape(-1, 8)
    not_measured = np.zeros(4)
    sigmas = [not_measured if t.corner_sigma_px is None else t.corner_sigma_px for t in tags]
    return which, corners, np.array(sigmas, dtype=np.float64)


def equally_good(layout: StateLayout, tags: Sequence[TagDetection], sigma_px: float) -> Seen:
    """Return measured corners that are all equally good and independent, for a target that stands.

    Args:
        layout: Layout of the state, which knows the tags.
        tags: Tags of the target.
        sigma_px: Standard deviation of each corner coordinate [px].
    """
    which, corners, _ = measured_corners(layout, tags)
    roots = np.tile(sigma_px * np.eye(8), (len(which), 1, 1))
    return Seen(which, corners, np.zeros(len(which)), roots, AT_REST)


def fit_corners(
    target: TargetModel,
    layout: StateLayout,
    seen: Seen,
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
    state, covariance, chi2, cost, converged, solvable = fit(
        target.optics, layout.tags, seen, start, prior_mean, prior_information, max_iterations, _TOLERANCE
    )
    if not solvable:
        raise np.linalg.LinAlgError("corners and prior leave a direction of the state open")
    state[YAW] = math.remainder(state[YAW], 2.0 * math.pi)
    return CornerFit(state, covariance, chi2, cost, converged)
