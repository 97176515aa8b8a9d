"""Measured corners: their covariances, and their residuals and derivatives by these."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.calibrated import BORDER, PARAMETERS, TargetTags, project_tag
from msrr_perception.kernels.compiled import kernel, subroutine
from msrr_perception.kernels.edges import BY_OFFSET, BY_SLOPE
from msrr_perception.kernels.linear_algebra import cholesky
from msrr_perception.kernels.project import Optics
from msrr_perception.kernels.rates import Rates
from msrr_perception.kernels.section_errors import CornerVariances
from msrr_scenes.arrays import Array

#: Way in the image after which an edge lies at another place between the pixels [px], and the largest number
#: of exposures that count as one.
_ANOTHER_PLACE_PX, _MOST_REPEATED = 0.5, 250.0

#: Number of exposures of an approach, in which what lies beyond the borders moves an edge by as much.
_LASTING_FRAMES = 60.0


class MeasuredCorners(NamedTuple):
    """What is measured of K tags in one exposure."""

    which: NDArray[np.int64]  # (K,) index of each tag among those of the target
    corners: Array  # (K, 8) pixels, ordered u0, v0, u1, v1 ...
    sigma_px: Array  # (K, 4) standard deviation of each corner as the image shows it; 0 if it does not
    after: Array  # (K, 4) time from the stamp to the exposure of each corner's row [s]


class WeightedCorners(NamedTuple):
    """The K tags that were detected in one exposure, as a fit takes them."""

    which: NDArray[np.int64]  # (K,) index of each tag among those of the target
    corners: Array  # (K, 8) measured pixels, ordered u0, v0, u1, v1 ...
    after: Array  # (K, 4) time from the stamp to the exposure of each corner's row [s]
    border: Array  # (K,) distance by which what lies beyond the borders may move an edge [px]
    roots: Array  # (K, 8, 8) lower triangles L, with covariance L L^T of the pixels of a tag [px]
    rates: Rates  # how the unit moves about the exposure


@kernel
def roots_of_covariance(
    optics: Optics,
    tags: TargetTags,
    measured: MeasuredCorners,
    rates: Rates,
    state: Array,
    variances: CornerVariances,
    period: float,
) -> Array:
    """Return the lower triangles of the covariances of measured corners, shape (K, 8, 8).

    The errors of an edge move both of its corners. Those that depend on where it lies between pixels are the
    same in all exposures until the tag has moved in the image. As a filter takes them for noise that is drawn
    anew, their variance is multiplied by the number of exposures that it takes. To this comes what is not
    known of the calibration and is not in the state either. What lies beyond the borders of a tag moves its
    edges alike all along an approach, but for a part that changes with the view.

    Args:
        optics: Camera and its mounting.
        tags: The tags of the target.
        measured: Corners of the K tags.
        rates: How the unit moves about the exposure.
        state: Predicted state, shape (n,) with n >= 5.
        variances: Variances of the corners.
        period: Time between two exposures [s].
    """
    which, corners, after = measured.which, measured.corners, measured.after
    pixels, J, S = np.empty(8), np.empty((8, PARAMETERS)), np.empty((8, 8))
    roots, velocity = np.zeros((which.shape[0], 8, 8)), rates.velocity[rates.velocity.shape[0] // 2]
    for t in range(which.shape[0]):
        project_tag(optics, tags, which[t], 0.0, rates, after[t], state, pixels, J)
        moved = 0.0
        for r in range(8):
            speed = J[r, 0] * velocity[0] + J[r, 1] * velocity[1] + J[r, 2] * velocity[2]
            moved = max(moved, abs(speed) * period)
            for q in range(8):
                S[r, q] = variances.rest[t, r // 2] if r == q else 0.0
        repeated = min(max(_ANOTHER_PLACE_PX / max(moved, 1e-9), 1.0), _MOST_REPEATED)
        section = variances.noise[t] + repeated * variances.place[t]
        # All cross sections of an edge have what lies beyond the border in common: no mean makes it less.
        changing = repeated * variances.changing[t]
        if tags.columns[which[t], BORDER] < 0:
            changing += _LASTING_FRAMES * variances.border[t] ** 2
        offset, slope = section * BY_OFFSET * BY_OFFSET + changing, (section + changing) * BY_SLOPE * BY_SLOPE
        same, other = offset + slope, offset - slope
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


@subroutine
def whitened(
    optics: Optics, tags: TargetTags, seen: WeightedCorners, t: int, state: Array, pixels: Array, J: Array
) -> None:
    """Write the residual of a tag into ``pixels`` and its derivatives into ``J``, both by its covariance."""
    tag, L = seen.which[t], seen.roots[t]
    project_tag(optics, tags, tag, seen.border[t], seen.rates, seen.after[t], state, pixels, J)
    for r in range(8):
        total = seen.corners[t, r] - pixels[r]
        for k in range(r):
            total -= L[r, k] * pixels[k]
        pixels[r] = total / L[r, r]
    for r in range(8):  # all columns at once, also those that the state does not have: the loop is faster
        for k in range(r):
            factor = L[r, k]
            for c in range(PARAMETERS):
                J[r, c] -= factor * J[k, c]
        pivot = L[r, r]
        for c in range(PARAMETERS):
            J[r, c] /= pivot


@kernel
def derivatives(optics: Optics, tags: TargetTags, seen: WeightedCorners, state: Array) -> tuple[Array, Array]:
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
