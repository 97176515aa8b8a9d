"""Kernel of the least squares over corners (see :mod:`msrr_perception.pose.corner_fit`)."""

from __future__ import annotations

import math

import numpy as np

from msrr_perception.kernels.calibrated import PARAMETERS, TargetTags
from msrr_perception.kernels.compiled import kernel, subroutine
from msrr_perception.kernels.corners import WeightedCorners, whitened
from msrr_perception.kernels.linear_algebra import cholesky, inverse, solve
from msrr_perception.kernels.project import Optics
from msrr_scenes.arrays import Array

_YAW = 2
_MAX_DAMPING = 1e9


@subroutine
def linearise(
    optics: Optics,
    tags: TargetTags,
    seen: WeightedCorners,
    state: Array,
    mean: Array,
    information: Array,
    pixels: Array,
    J: Array,
    H: Array,
    g: Array,
) -> tuple[float, float]:
    """Write the Hessian H and the descent direction g at ``state``; return chi2 and cost."""
    n, off, pulled = state.shape[0], state - mean, 0.0
    off[_YAW] -= 2.0 * math.pi * np.rint(off[_YAW] / (2.0 * math.pi))
    for i in range(n):
        pull = 0.0
        for j in range(n):
            pull += information[i, j] * off[j]
            H[i, j] = information[i, j]
        pulled += off[i] * pull
        g[i] = -pull
    chi2 = 0.0
    for t in range(seen.which.shape[0]):
        whitened(optics, tags, seen, t, state, pixels, J)
        columns = tags.columns[seen.which[t]]
        for r in range(8):
            chi2 += pixels[r] * pixels[r]
        for a in range(PARAMETERS):
            i = columns[a]
            if i < 0:
                continue
            total = 0.0
            for r in range(8):
                total += J[r, a] * pixels[r]
            g[i] += total
            for b in range(a + 1):
                j = columns[b]
                if j < 0:
                    continue
                total = 0.0
                for r in range(8):
                    total += J[r, a] * J[r, b]
                H[i, j] += total
                if a != b:
                    H[j, i] += total
    return chi2, chi2 + pulled


@kernel
def fit(
    optics: Optics,
    tags: TargetTags,
    seen: WeightedCorners,
    start: Array,
    mean: Array,
    information: Array,
    max_iterations: int,
    tolerance: float,
) -> tuple[Array, Array, float, float, bool]:
    """Find the state that explains the corners best.

    Args:
        optics: Camera and its mounting.
        tags: The tags of the target, and where the state has what they depend on.
        seen: Measured corners.
        start: First guess, shape (n,) with n >= 5.
        mean: Mean of the prior, shape (n,).
        information: Information matrix of the prior, shape (n, n).
        max_iterations: Largest number of linearisations.
        tolerance: Step at which the iteration stops, in standard deviations of the solution.

    Returns:
        State, covariance, chi2, cost, and whether the equations had a solution at all.
    """
    n = start.shape[0]
    pixels, J = np.empty(8), np.empty((8, PARAMETERS))
    H, g, H_new, g_new = np.empty((n, n)), np.empty(n), np.empty((n, n)), np.empty(n)
    A, L, step, covariance = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty((n, n))
    state, trial = start.copy(), np.empty(n)
    damping, solvable = 0.0, True
    chi2, cost = linearise(optics, tags, seen, state, mean, information, pixels, J, H, g)
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
            break
        for i in range(n):
            trial[i] = state[i] + step[i]
        chi2_new, cost_new = linearise(optics, tags, seen, trial, mean, information, pixels, J, H_new, g_new)
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
    return state, covariance, chi2, cost, solvable
