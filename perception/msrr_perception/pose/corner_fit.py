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

from msrr_perception.kernels.calibrated import AT_REST
from msrr_perception.kernels.corners import Seen
from msrr_perception.kernels.fit import fit
from msrr_perception.pose.calibration import StateLayout
from msrr_perception.pose.target import YAW, TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.messages import TagDetection

#: Step at which the iteration stops, in standard deviations of the solution.
_TOLERANCE = 1e-3


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


def equally_good(layout: StateLayout, tags: Sequence[TagDetection], sigma_px: float) -> Seen:
    """Return measured corners that are all equally good and independent, for a target that stands.

    Args:
        layout: Layout of the state, which knows the tags.
        tags: Tags of the target.
        sigma_px: Standard deviation of each corner coordinate [px].
    """
    which = np.array([layout.index[t.tag_id] for t in tags], dtype=np.int64)
    corners = np.array([t.corners for t in tags], dtype=np.float64).reshape(-1, 8)
    roots = np.tile(sigma_px * np.eye(8), (len(which), 1, 1))
    return Seen(which, corners, roots, AT_REST)


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
