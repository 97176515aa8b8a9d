"""Kernel of the update of a filter by corners: the iterated extended Kalman filter, for sparse derivatives.

The state has more entries than an exposure has corners, and every tag shows a part of them. So the equations
are those of the corners, and the covariance of the state is never inverted. While the cost falls, the steps
are those of Gauss-Newton (Bell and Cathey, "The iterated Kalman filter update as a Gauss-Newton method", IEEE
TAC 38, 1993), which :mod:`msrr_perception.kernels.fit` damps where it rises.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.calibrated import PARAMETERS, PRINT, TargetTags
from msrr_perception.kernels.compiled import kernel, subroutine
from msrr_perception.kernels.corners import MeasuredCorners, WeightedCorners, roots_of_covariance, whitened
from msrr_perception.kernels.linear_algebra import cholesky, solve
from msrr_perception.kernels.project import Optics
from msrr_perception.kernels.rates import Rates
from msrr_perception.kernels.section_errors import DataSheet, variances_of_corners
from msrr_scenes.arrays import Array

#: Rise of the cost with a step that counts as none: that of a state 0.1 standard deviations off. Derivatives
#: are to first order in the errors of calibration, so that steps end this near to the minimum and not in it.
_NO_RISE = 0.01


class Rules(NamedTuple):
    """The rules of an update."""

    gate: float  # squared Mahalanobis distance from which a tag is left out
    iterations: int  # largest number of linearisations
    tolerance: float  # step at which the iteration stops, in standard deviations of the solution


@subroutine
def relate(
    tags: TargetTags, which: NDArray[np.int64], covariance: Array, J: Array, JP: Array, S: Array
) -> None:
    """Write how the corners of tags depend on the state's covariance.

    Args:
        tags: The tags of the target.
        which: Index of each measured tag, shape (K,).
        covariance: Covariance P of the state, shape (n, n).
        J: Derivatives of the corners by the parameters of their tag, shape (8 K, PARAMETERS).
        JP: Output, derivatives by the state times P, shape (8 K, n).
        S: Output, lower triangle of ``1 + J P J^T``, shape (8 K, 8 K).
    """
    n = covariance.shape[0]
    for row in range(JP.shape[0]):
        columns = tags.columns[which[row // 8]]
        JP[row, :] = 0.0
        for c in range(PARAMETERS):
            if columns[c] >= 0:
                column, factor = columns[c], J[row, c]
                for k in range(n):  # a view of the row of P would be counted as a reference to it each time
                    JP[row, k] += factor * covariance[column, k]
    for q in range(JP.shape[0]):
        columns = tags.columns[which[q // 8]]
        for row in range(q, JP.shape[0]):
            total = 1.0 if row == q else 0.0
            for c in range(PARAMETERS):
                if columns[c] >= 0:
                    total += JP[row, columns[c]] * J[q, c]
            S[row, q] = total


@subroutine
def distances(S: Array, r: Array) -> Array:
    """Return each tag's squared Mahalanobis distance from the prediction, shape (K,), infinite if undefined.

    Args:
        S: Lower triangle of the covariance of the residuals, shape (8 K, 8 K).
        r: Residuals, shape (8 K,).
    """
    out, L, solved = np.full(r.shape[0] // 8, np.inf), np.zeros((8, 8)), np.empty(8)
    for t in range(out.shape[0]):
        of_tag = slice(8 * t, 8 * t + 8)
        if cholesky(S[of_tag, of_tag], L):
            solve(L, r[of_tag], solved)
            out[t] = np.dot(r[of_tag], solved)
    return out


@kernel
def scaled_prior(tags: TargetTags, mean: Array, covariance: Array, state: Array) -> tuple[Array, Array]:
    """Return mean and covariance of a prior that is Gaussian in lengths by the print, linear at a state.

    Images show no lengths, but how many times as long as the print they are: the distance from the marker,
    the radii of the wheels, and the distances between tags. What such a length in metres changes by with the
    print depends on the length. Linear at one state after the other, a filter would take corrections of its
    place for sights of the scale, and believe ever smaller prints.

    Args:
        tags: The tags of the target, and which entries of the state are lengths.
        mean: Mean of the prior, shape (n,).
        covariance: Covariance of the prior, shape (n, n).
        state: State at which the prior is linear, shape (n,).
    """
    base, prior = mean.copy(), covariance.copy()
    k = tags.columns[0, PRINT]
    if k < 0:
        return base, prior
    n, before, now = mean.shape[0], 1.0 + mean[k], 1.0 + state[k]
    larger = now / before
    for i in range(tags.lengths.shape[0]):
        row, origin = tags.lengths[i], tags.origins[i]
        length, at = (mean[row] - origin) / before, (state[row] - origin) / now
        base[row] = state[row] - now * (at - length) - at * (now - before)
        by_print = at - larger * length
        for j in range(n):
            prior[row, j] = larger * prior[row, j] + by_print * prior[k, j]
        for j in range(n):
            prior[j, row] = larger * prior[j, row] + by_print * prior[j, k]
    return base, prior


@kernel
def update(
    optics: Optics,
    tags: TargetTags,
    measured: MeasuredCorners,
    rates: Rates,
    sheet: DataSheet,
    scale: float,
    period: float,
    mean: Array,
    covariance: Array,
    rules: Rules,
) -> tuple[Array, Array, float, float, WeightedCorners, bool]:
    """Correct a state by the corners of those tags that lie inside the gate.

    Args:
        optics: Camera and its mounting.
        tags: The tags of the target, and where the state has what they depend on.
        measured: Corners of the K tags.
        rates: How the unit moves about the exposure.
        sheet: What the errors of the corners depend on.
        scale: Factor on the variances by data sheet.
        period: Time between two exposures [s].
        mean: Mean of the state before, shape (n,).
        covariance: Its covariance, shape (n, n).
        rules: Gate and end of the iteration.

    Returns:
        State, covariance, squared residuals of the corners, minus twice the logarithm of the likelihood of
        these by the prior but for a constant (by Laplace's method), the tags inside the gate, and whether the
        cost fell with every step and all variances are positive; if not, or without a tag inside the gate,
        the state is not to be used.
    """
    n, which, corners = mean.shape[0], measured.which, measured.corners
    variances = variances_of_corners(corners, measured.sigma_px, sheet, scale)
    roots = roots_of_covariance(optics, tags, measured, rates, mean, variances, period)
    seen = WeightedCorners(which, corners, measured.after, variances.border, roots, rates)
    rows = 8 * which.shape[0]
    r, J, JP, S = np.empty(rows), np.empty((rows, PARAMETERS)), np.empty((rows, n)), np.empty((rows, rows))
    for t in range(which.shape[0]):
        whitened(optics, tags, seen, t, mean, r[8 * t : 8 * t + 8], J[8 * t : 8 * t + 8])
    relate(tags, which, covariance, J, JP, S)
    inside = distances(S, r) <= rules.gate
    if not inside.all():
        seen = WeightedCorners(
            which[inside], corners[inside], seen.after[inside], seen.border[inside], roots[inside], rates
        )
        rows = 8 * seen.which.shape[0]
        of_tags = np.repeat(inside, 8)
        r, J, JP, S = r[of_tags], J[of_tags], JP[of_tags], S[of_tags][:, of_tags].copy()
    # The deviation from the prior is d = P u throughout, so that d . u is the prior's part of the cost.
    state, d, u, d_new, u_new = mean.copy(), np.zeros(n), np.zeros(n), np.empty(n), np.empty(n)
    L, z, w = np.zeros((rows, rows)), np.empty(rows), np.empty(rows)
    base, prior = mean, covariance
    chi2 = np.dot(r, r)
    cost, fell = chi2, rows > 0
    for _ in range(rules.iterations):
        fell = fell and cholesky(S, L)
        if not fell:
            break
        z[:] = r
        for row in range(rows):
            columns = tags.columns[seen.which[row // 8]]
            for c in range(PARAMETERS):
                if columns[c] >= 0:
                    z[row] += J[row, c] * d[columns[c]]
        solve(L, z, w)
        d_new[:], u_new[:], length = 0.0, 0.0, 0.0
        for row in range(rows):
            columns, left = tags.columns[seen.which[row // 8]], r[row] - w[row]
            length += left * left
            for k in range(n):
                d_new[k] += w[row] * JP[row, k]
            for c in range(PARAMETERS):
                if columns[c] >= 0:
                    u_new[columns[c]] += w[row] * J[row, c]
        for k in range(n):
            length += (d_new[k] - d[k]) * (u_new[k] - u[k])
        if length < rules.tolerance * rules.tolerance * n:
            break
        d[:], u[:] = d_new, u_new
        for k in range(n):
            state[k] = base[k] + d[k]
        by_prior = np.dot(d, u)
        base, prior = scaled_prior(tags, mean, covariance, state)
        for k in range(n):
            d[k] = state[k] - base[k]
        for t in range(seen.which.shape[0]):
            whitened(optics, tags, seen, t, state, r[8 * t : 8 * t + 8], J[8 * t : 8 * t + 8])
        relate(tags, seen.which, prior, J, JP, S)
        chi2, before = np.dot(r, r), cost
        cost = chi2 + by_prior
        fell = cost <= before + _NO_RISE
    P = prior.copy()
    fell = fell and cholesky(S, L)
    if fell:
        for row in range(rows):
            cost += 2.0 * math.log(L[row, row])
        reduce(P, L, JP)
        for k in range(n):  # where a tag is next to the plane of the camera, rounding leaves nothing of some
            fell = fell and P[k, k] > 0.0
    return state, P, chi2, cost, seen, fell


@subroutine
def reduce(P: Array, L: Array, JP: Array) -> None:
    """Subtract ``(J P)^T S^-1 J P`` from the covariance P, with ``S = L L^T``; JP is overwritten."""
    n = P.shape[0]
    for i in range(JP.shape[0]):
        for k in range(i):
            factor = L[i, k]
            for j in range(n):
                JP[i, j] -= factor * JP[k, j]
        scale = 1.0 / L[i, i]
        for j in range(n):
            JP[i, j] *= scale
    for row in range(JP.shape[0]):
        for i in range(n):
            factor = JP[row, i]
            for j in range(i + 1):
                P[i, j] -= factor * JP[row, j]
    for i in range(n):
        for j in range(i):
            P[j, i] = P[i, j]
