"""Kernels of the least squares over corners (see :mod:`msrr_perception.pose.corner_fit`) and of the gate."""

from __future__ import annotations

import math

import numpy as np

from msrr_perception.kernels.compiled import inlined, kernel
from msrr_perception.kernels.project import Optics, project_into
from msrr_scenes.arrays import Array

_YAW = 2
_MAX_DAMPING = 1e9


@inlined
def cholesky(A: Array, L: Array) -> bool:
    """Write the lower triangle L with ``L L^T = A``; return whether A is positive definite."""
    n = A.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                L[i, i] = math.sqrt(total)
            else:
                L[i, j] = total / L[j, j]
    return True


@inlined
def solve(L: Array, b: Array, out: Array) -> None:
    """Write the solution of ``L L^T out = b``."""
    n = L.shape[0]
    for i in range(n):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * out[k]
        out[i] = total / L[i, i]
    for i in range(n - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, n):
            total -= L[k, i] * out[k]
        out[i] = total / L[i, i]


@inlined
def inverse(L: Array, out: Array) -> None:
    """Write the inverse of ``L L^T``, symmetric to the last bit."""
    n = L.shape[0]
    unit, column = np.empty(n), np.empty(n)
    for j in range(n):
        for i in range(n):
            unit[i] = 1.0 if i == j else 0.0
        solve(L, unit, column)
        for i in range(j, n):
            out[i, j] = out[j, i] = column[i]


@inlined
def linearise(
    optics: Optics,
    points: Array,
    seen: Array,
    weight: float,
    state: Array,
    mean: Array,
    information: Array,
    pixels: Array,
    J: Array,
    H: Array,
    g: Array,
) -> tuple[float, float]:
    """Write the Hessian H and the descent direction g at ``state``; return chi2 and cost."""
    project_into(optics, state, points, pixels, J)
    n = state.shape[0]
    pulled = 0.0
    for i in range(n):
        pull = 0.0
        for j in range(n):
            d = state[j] - mean[j]
            if j == _YAW:
                d -= 2.0 * math.pi * np.rint(d / (2.0 * math.pi))
            pull += information[i, j] * d
            H[i, j] = information[i, j]
        d = state[i] - mean[i]
        if i == _YAW:
            d -= 2.0 * math.pi * np.rint(d / (2.0 * math.pi))
        pulled += d * pull
        g[i] = -pull
    chi2 = 0.0
    for r in range(seen.shape[0]):
        residual = seen[r] - pixels[r]
        chi2 += residual * residual
        for i in range(5):
            k = weight * J[r, i]
            g[i] += k * residual
            for j in range(i + 1):
                H[i, j] += k * J[r, j]
    for i in range(5):
        for j in range(i):
            H[j, i] = H[i, j]
    return weight * chi2, weight * chi2 + pulled


@kernel
def fit(
    optics: Optics,
    points: Array,
    seen: Array,
    weight: float,
    start: Array,
    mean: Array,
    information: Array,
    max_iterations: int,
    tolerance: float,
) -> tuple[Array, Array, float, float, bool, bool]:
    """Find the state that explains the corners best.

    Args:
        optics: Camera and its mounting.
        points: Corners in D, shape (N, 3) [m].
        seen: Measured pixels of the corners, shape (2 N,).
        weight: Weight 1 / sigma^2 of a coordinate [1/px^2].
        start: First guess, shape (n,) with n >= 5.
        mean: Mean of the prior, shape (n,).
        information: Information matrix of the prior, shape (n, n).
        max_iterations: Largest number of linearisations.
        tolerance: Step at which the iteration stops, in standard deviations of the solution.

    Returns:
        State, covariance, chi2, cost, whether the last step was below the tolerance, and whether the
        equations had a solution at all.
    """
    n, rows = start.shape[0], seen.shape[0]
    pixels, J = np.empty(rows), np.empty((rows, 5))
    H, g, H_new, g_new = np.empty((n, n)), np.empty(n), np.empty((n, n)), np.empty(n)
    A, L, step, covariance = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty((n, n))
    state, trial = start.copy(), np.empty(n)
    damping, converged, solvable = 0.0, False, True
    chi2, cost = linearise(optics, points, seen, weight, state, mean, information, pixels, J, H, g)
    for _ in range(max_iterations):
        for i in range(n):
            for j in range(n):
                A[i, j] = H[i, j]
            A[i, i] += damping * H[i, i]
        solvable = cholesky(A, L)
        if not solvable:
            break
        solve(L, g, step)
        length = 0.0
        for i in range(n):
            for j in range(n):
                length += step[i] * H[i, j] * step[j]
        if length < tolerance * tolerance * n:
            converged = True
            break
        for i in range(n):
            trial[i] = state[i] + step[i]
        chi2_new, cost_new = linearise(
            optics, points, seen, weight, trial, mean, information, pixels, J, H_new, g_new
        )
        if cost_new <= cost:
            state, trial = trial, state
            H, H_new, g, g_new = H_new, H, g_new, g
            chi2, cost = chi2_new, cost_new
            damping = 0.1 * damping if damping > 1e-6 else 0.0
        else:
            damping = max(10.0 * damping, 1e-3)
            if damping > _MAX_DAMPING:
                break
    solvable = solvable and cholesky(H, L)
    if solvable:
        inverse(L, covariance)
    return state, covariance, chi2, cost, converged, solvable


@kernel
def gate_distances(
    optics: Optics, points: Array, seen: Array, sigma: float, state: Array, covariance: Array
) -> Array:
    """Return each tag's squared Mahalanobis distance from the prediction, shape (T,), infinite if undefined.

    Args:
        optics: Camera and its mounting.
        points: Four corners of each tag in D, shape (4 T, 3) [m].
        seen: Measured pixels of the corners, shape (8 T,).
        sigma: Standard deviation of each coordinate [px].
        state: Predicted state, shape (n,) with n >= 5.
        covariance: Covariance of the state, shape (n, n).
    """
    tags = points.shape[0] // 4
    out = np.empty(tags)
    pixels, J = np.empty(8), np.empty((8, 5))
    S, L, residual, solved = np.empty((8, 8)), np.zeros((8, 8)), np.empty(8), np.empty(8)
    half = np.empty((8, 5))
    for t in range(tags):
        project_into(optics, state, points[4 * t : 4 * t + 4], pixels, J)
        for r in range(8):
            residual[r] = seen[8 * t + r] - pixels[r]
            for b in range(5):
                total = 0.0
                for a in range(5):
                    total += J[r, a] * covariance[a, b]
                half[r, b] = total
        for r in range(8):
            for q in range(8):
                total = sigma * sigma if r == q else 0.0
                for b in range(5):
                    total += half[r, b] * J[q, b]
                S[r, q] = total
        out[t] = np.inf
        if cholesky(S, L):
            solve(L, residual, solved)
            total = 0.0
            for r in range(8):
                total += residual[r] * solved[r]
            out[t] = total
    return out
