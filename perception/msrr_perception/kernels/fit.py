"""Kernels of the least squares over corners (see :mod:`msrr_perception.pose.corner_fit`) and of the gate."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.calibrated import PARAMETERS, TagMap, project_tag
from msrr_perception.kernels.compiled import inlined, kernel
from msrr_perception.kernels.project import Optics
from msrr_scenes.arrays import Array

_YAW = 2
_MAX_DAMPING = 1e9

#: Way in the image after which an edge lies at another place between the pixels [px], and the largest number
#: of exposures that count as one.
_ANOTHER_PLACE_PX, _MOST_REPEATED = 0.5, 250.0


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


class Seen(NamedTuple):
    """The K tags that were detected in one exposure."""

    which: NDArray[np.int64]  # (K,) index of each tag in the map of the target
    corners: Array  # (K, 8) measured pixels, ordered u0, v0, u1, v1 ...
    roots: Array  # (K, 8, 8) lower triangles L, with covariance L L^T of the pixels of a tag [px]
    rates: Array  # (3,) velocity of (x, y, yaw) in D at the exposure [m/s, rad/s]


class CornerVariances(NamedTuple):
    """Variances of the corners of K tags [px^2]."""

    noise: Array  # (K,) of a cross section of an edge, drawn anew in every exposure
    place: Array  # (K,) of a cross section, by where the edge lies between pixels
    rest: float  # of each coordinate, independent of all others


@kernel
def roots_of_covariance(
    optics: Optics,
    tags: TagMap,
    which: NDArray[np.int64],
    corners: Array,
    rates: Array,
    state: Array,
    variances: CornerVariances,
    by_offset: float,
    by_slope: float,
    period: float,
) -> Array:
    """Return the lower triangles of the covariances of measured corners, shape (K, 8, 8).

    The errors of an edge move both of its corners. Those that depend on where it lies between pixels are the
    same in all exposures until the tag has moved in the image. As a filter takes them for noise that is drawn
    anew, their variance is multiplied by the number of exposures that it takes. To this comes what is not
    known of the calibration and is not in the state either.

    Args:
        optics: Camera and its mounting.
        tags: The tags of the target.
        which: Index of each measured tag, shape (K,).
        corners: Measured pixels, shape (K, 8).
        rates: Velocity of ``(x, y, yaw)`` in D at the exposure, shape (3,).
        state: Predicted state, shape (n,) with n >= 5.
        variances: Variances by noise and by place.
        by_offset: Offset of a line at its ends for an error of one cross section.
        by_slope: The same for its slope.
        period: Time between two exposures [s].
    """
    pixels, J, S = np.empty(8), np.empty((8, PARAMETERS)), np.empty((8, 8))
    roots = np.zeros((which.shape[0], 8, 8))
    for t in range(which.shape[0]):
        project_tag(optics, tags, which[t], rates, state, pixels, J)
        moved = 0.0
        for r in range(8):
            speed = J[r, 0] * rates[0] + J[r, 1] * rates[1] + J[r, 2] * rates[2]
            moved = max(moved, abs(speed) * period)
            for q in range(8):
                S[r, q] = variances.rest if r == q else 0.0
        repeated = min(max(_ANOTHER_PLACE_PX / max(moved, 1e-9), 1.0), _MOST_REPEATED)
        section = variances.noise[t] + repeated * variances.place[t]
        same = section * (by_offset * by_offset + by_slope * by_slope)
        other = section * (by_offset * by_offset - by_slope * by_slope)
        for e in range(4):
            a, b = 2 * e, 2 * ((e + 1) % 4)
            du, dv = corners[t, b] - corners[t, a], corners[t, b + 1] - corners[t, a + 1]
            length = max(math.hypot(du, dv), 1e-6)
            nu, nv = dv / length, -du / length
            for i in range(2):
                for j in range(2):
                    both = (nu if i == 0 else nv) * (nu if j == 0 else nv)
                    S[a + i, a + j] += same * both
                    S[b + i, b + j] += same * both
                    S[a + i, b + j] += other * both
                    S[b + i, a + j] += other * both
        for k in range(PARAMETERS):
            variance = tags.considered[which[t], k]
            if variance > 0.0:
                for r in range(8):
                    for q in range(8):
                        S[r, q] += variance * J[r, k] * J[q, k]
        cholesky(S, roots[t])
    return roots


@inlined
def whitened(optics: Optics, tags: TagMap, seen: Seen, t: int, state: Array, pixels: Array, J: Array) -> None:
    """Write the residual of a tag into ``pixels`` and its derivatives into ``J``, both by its covariance."""
    tag, L = seen.which[t], seen.roots[t]
    project_tag(optics, tags, tag, seen.rates, state, pixels, J)
    for r in range(8):
        total = seen.corners[t, r] - pixels[r]
        for k in range(r):
            total -= L[r, k] * pixels[k]
        pixels[r] = total / L[r, r]
    for c in range(PARAMETERS):
        if tags.columns[tag, c] >= 0:
            for r in range(8):
                entry = J[r, c]
                for k in range(r):
                    entry -= L[r, k] * J[k, c]
                J[r, c] = entry / L[r, r]


@inlined
def linearise(
    optics: Optics,
    tags: TagMap,
    seen: Seen,
    state: Array,
    mean: Array,
    information: Array,
    pixels: Array,
    J: Array,
    H: Array,
    g: Array,
) -> tuple[float, float]:
    """Write the Hessian H and the descent direction g at ``state``; return chi2 and cost."""
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
    tags: TagMap,
    seen: Seen,
    start: Array,
    mean: Array,
    information: Array,
    max_iterations: int,
    tolerance: float,
) -> tuple[Array, Array, float, float, bool, bool]:
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
        State, covariance, chi2, cost, whether the last step was below the tolerance, and whether the
        equations had a solution at all.
    """
    n = start.shape[0]
    pixels, J = np.empty(8), np.empty((8, PARAMETERS))
    H, g, H_new, g_new = np.empty((n, n)), np.empty(n), np.empty((n, n)), np.empty(n)
    A, L, step, covariance = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty((n, n))
    state, trial = start.copy(), np.empty(n)
    damping, converged, solvable = 0.0, False, True
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
            converged = True
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
    return state, covariance, chi2, cost, converged, solvable


@kernel
def gate_distances(optics: Optics, tags: TagMap, seen: Seen, state: Array, covariance: Array) -> Array:
    """Return each tag's squared Mahalanobis distance from the prediction, shape (K,), infinite if undefined.

    Args:
        optics: Camera and its mounting.
        tags: The tags of the target.
        seen: Measured corners.
        state: Predicted state, shape (n,) with n >= 5.
        covariance: Covariance of the state, shape (n, n).
    """
    count = seen.which.shape[0]
    out = np.empty(count)
    pixels, J = np.empty(8), np.empty((8, PARAMETERS))
    S, L, solved = np.empty((8, 8)), np.zeros((8, 8)), np.empty(8)
    half = np.empty((8, PARAMETERS))
    for t in range(count):
        whitened(optics, tags, seen, t, state, pixels, J)
        columns = tags.columns[seen.which[t]]
        for b in range(PARAMETERS):
            for r in range(8):
                half[r, b] = 0.0
            if columns[b] < 0:
                continue
            for a in range(PARAMETERS):
                if columns[a] >= 0:
                    entry = covariance[columns[a], columns[b]]
                    for r in range(8):
                        half[r, b] += J[r, a] * entry
        for r in range(8):
            for q in range(8):
                total = 1.0 if r == q else 0.0
                for b in range(PARAMETERS):
                    if columns[b] >= 0:
                        total += half[r, b] * J[q, b]
                S[r, q] = total
        out[t] = np.inf
        if cholesky(S, L):
            solve(L, pixels, solved)
            total = 0.0
            for r in range(8):
                total += pixels[r] * solved[r]
            out[t] = total
    return out


@kernel
def derivatives(optics: Optics, tags: TagMap, seen: Seen, state: Array) -> tuple[Array, Array]:
    """Return residuals, shape (8 K,), and derivatives, shape (8 K, n), both by the covariance of the corners.

    Args:
        optics: Camera and its mounting.
        tags: The tags of the target.
        seen: Measured corners.
        state: State, shape (n,).
    """
    count, n = seen.which.shape[0], state.shape[0]
    residuals, out = np.empty(8 * count), np.zeros((8 * count, n))
    J = np.empty((8, PARAMETERS))
    for t in range(count):
        whitened(optics, tags, seen, t, state, residuals[8 * t : 8 * t + 8], J)
        columns = tags.columns[seen.which[t]]
        for c in range(PARAMETERS):
            if columns[c] >= 0:
                for r in range(8):
                    out[8 * t + r, columns[c]] = J[r, c]
    return residuals, out
