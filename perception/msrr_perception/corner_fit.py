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

from msrr_perception.tag_camera import YAW, project_with_jacobian
from msrr_perception.target import TargetModel
from msrr_scenes.messages import Array

_MAX_DAMPING = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners seen in one exposure.

    Attributes:
        points_D: Where they are on the target, shape (N, 3) [m].
        pixels: Where they were seen, shape (2 N,), ordered u0, v0, u1, v1 ...
        sigma_px: Standard deviation of each coordinate.
    """

    points_D: Array
    pixels: Array
    sigma_px: float


@dataclass(frozen=True, slots=True, eq=False)
class CornerFit:
    """The minimum found.

    Attributes:
        state: Shape (n,); the first five are ``(x, y, yaw, pitch, roll)``.
        covariance: Inverse of the Gauss-Newton Hessian, shape (n, n).
        chi2: Squared residuals over sigma^2, without the prior's part.
        cost: The same with the prior's part.
        converged: The last step was below the tolerance.
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
    corners: Corners,
    start: Array,
    prior_mean: Array,
    prior_information: Array,
    max_iterations: int = 10,
    tolerance: float = 1e-3,
) -> CornerFit:
    """Find the state that explains the corners best.

    Args:
        target: Camera and mounting.
        corners: What was seen.
        start: First guess, shape (n,) with n >= 5; entries beyond the fifth do not show in the image.
        prior_mean: m, shape (n,).
        prior_information: Lambda, shape (n, n), positive semidefinite.
        max_iterations: Number of linearisations allowed.
        tolerance: Step at which it stops, in standard deviations of the solution.

    Returns:
        The best state found, with its covariance about that state.
    """
    n = start.shape[0]
    weight = 1.0 / (corners.sigma_px * corners.sigma_px)
    state, damping, converged = start.copy(), 0.0, False
    H, g, chi2, cost = _linearise(target, corners, state, prior_mean, prior_information, weight)
    for _ in range(max_iterations):
        step = np.linalg.solve(H + np.diag(damping * np.diagonal(H)) if damping else H, g)
        if float(step @ H @ step) < tolerance * tolerance * n:
            converged = True
            break
        trial = state + step
        new = _linearise(target, corners, trial, prior_mean, prior_information, weight)
        if new[3] <= cost:
            state, damping = trial, 0.1 * damping if damping > 1e-6 else 0.0
            H, g, chi2, cost = new
        else:
            damping = max(10.0 * damping, 1e-3)
            if damping > _MAX_DAMPING:
                break
    state[YAW] = math.remainder(state[YAW], 2.0 * math.pi)
    covariance = np.linalg.inv(H)
    return CornerFit(state, 0.5 * (covariance + covariance.T), chi2, cost, converged)


def _linearise(
    target: TargetModel, corners: Corners, state: Array, mean: Array, information: Array, weight: float
) -> tuple[Array, Array, float, float]:
    """Return Hessian, descent direction, chi2 and cost at ``state``."""
    predicted, J = project_with_jacobian(target, state[:5], corners.points_D)
    residual = corners.pixels - predicted
    d = deviation(state, mean)
    pull = information @ d
    H = information.copy()
    JT = J.T * weight
    H[:5, :5] += JT @ J
    g = -pull
    g[:5] += JT @ residual
    chi2 = weight * float(residual @ residual)
    return H, g, chi2, chi2 + float(d @ pull)
