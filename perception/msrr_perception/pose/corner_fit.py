"""Least squares over tag corners with a Gaussian prior, by Gauss-Newton with Levenberg-Marquardt damping.

The joint pose (hardly any prior) and the filter's iterated update (the prediction as prior) are the same
problem: minimise |pixels - h(x)|^2 / sigma^2 + (x - m)^T Lambda (x - m). The iterated extended Kalman update
equals this Gauss-Newton descent (Bell and Cathey, "The iterated Kalman filter update as a Gauss-Newton
method", IEEE TAC 38, 1993).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from msrr_perception.kernels.fit import fit
from msrr_perception.pose.target import YAW, TargetModel
from msrr_scenes.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class CornerMeasurements:
    """The tag corners measured in one exposure.

    Attributes:
        points_D: Corners in the dock frame D, shape (N, 3) [m].
        pixels: Measured pixels of the corners, shape (2 N,), ordered u0, v0, u1, v1 ...
        sigma_px: Standard deviation of each pixel coordinate [px].
    """

    points_D: Array
    pixels: Array
    sigma_px: float


@dataclass(frozen=True, slots=True, eq=False)
class CornerFit:
    """The minimum that a fit found.

    Attributes:
        state: State, shape (n,); the first five entries are ``(x, y, yaw, pitch, roll)``.
        covariance: Inverse of the Gauss-Newton Hessian, shape (n, n).
        chi2: Sum of the squared residuals over sigma^2, without the prior's part.
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


def fit_corners(
    target: TargetModel,
    corners: CornerMeasurements,
    start: Array,
    prior_mean: Array,
    prior_information: Array,
    max_iterations: int = 10,
    tolerance: float = 1e-3,
) -> CornerFit:
    """Find the state that explains the corners best.

    Args:
        target: Camera and its mounting.
        corners: Measured corners.
        start: First guess, shape (n,) with n >= 5; entries beyond the fifth do not affect the image.
        prior_mean: Mean m of the prior, shape (n,).
        prior_information: Information matrix Lambda of the prior, shape (n, n), positive semidefinite.
        max_iterations: Largest number of linearisations.
        tolerance: Step at which the iteration stops, in standard deviations of the solution.

    Returns:
        The best state found, with the covariance about that state.

    Raises:
        numpy.linalg.LinAlgError: Corners and prior together do not fix every direction of the state.
    """
    weight = 1.0 / (corners.sigma_px * corners.sigma_px)
    state, covariance, chi2, cost, converged, solvable = fit(
        target.optics,
        corners.points_D,
        corners.pixels,
        weight,
        start,
        prior_mean,
        prior_information,
        max_iterations,
        tolerance,
    )
    if not solvable:
        raise np.linalg.LinAlgError("corners and prior leave a direction of the state open")
    state[YAW] = math.remainder(state[YAW], 2.0 * math.pi)
    return CornerFit(state, covariance, chi2, cost, converged)
