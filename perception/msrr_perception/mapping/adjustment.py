"""Bundle adjustment: sparse least squares by Levenberg and Marquardt, robust or not, with covariances.

The normal equations are factorised as a sparse matrix. (The iterative solver to which scipy's
``least_squares`` resorts where a Jacobian is sparse needs thousands of products for a chain of views, and
took sixty times as long for forty of them. A test compares the two results.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import SuperLU, splu

from msrr_perception.mapping.bundle import Bundle, Sightings
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError

#: Distances of a corner from which on it counts less [px], one adjustment each: with the first, what is far
#: off still pulls, so that a poor first guess leads to the same place as a good one; with the last, wrong
#: corners hardly count. Source: A. Blake, A. Zisserman, Visual Reconstruction, 1987 (graduated non-
#: convexity).
_GRADUATED_PX = (100.0, 10.0, 1.0)

#: Most steps, and the relative gain of the cost that a step promises at which they end: in general, and where
#: another adjustment goes on from there.
_STEPS, _SETTLED, _ALMOST_SETTLED = 200, 1e-12, 1e-6

#: Damping of the first step, relative to the diagonal of the normal equations, its factor from step to
#: step, and its bounds; beyond the upper one no step helps.
_DAMPING, _FACTOR, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 10.0, 1e-12, 1e6


class AdjustmentError(MsrrError):
    """The sightings do not determine a map."""


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The result of least squares.

    Attributes:
        bundle: The poses.
        residuals: Projected minus detected corners, shape (8 N,) [px].
        jacobian: Their derivatives by the variables of the bundle, shape (8 N, n).
        factor: Factorisation of the normal equations.
    """

    bundle: Bundle
    residuals: Array
    jacobian: csr_array
    factor: SuperLU

    @cached_property
    def redundancy(self) -> int:
        """Number of corner coordinates beyond those that it takes to find the variables."""
        return len(self.residuals) - len(np.unique(self.jacobian.indices))

    @cached_property
    def sigma_px(self) -> float:
        """Standard deviation of the coordinates of corners, from the residuals [px]."""
        return math.sqrt(float(self.residuals @ self.residuals) / max(self.redundancy, 1))

    def cofactors(self, columns: NDArray[np.intp]) -> Array:
        """Return the covariance of variables, by their indices, for corners of variance 1; shape (c, c)."""
        unit = np.zeros((self.bundle.variables, len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        Q = self.factor.solve(unit)[columns]
        return np.asarray(0.5 * (Q + Q.T))


def adjust_robustly(bundle: Bundle, seen: Sightings) -> Bundle:
    """Return the poses that explain the sightings but for a few that may be wrong, from a first guess."""
    for scale_px in _GRADUATED_PX:
        bundle = adjust(bundle, seen, scale_px, _ALMOST_SETTLED).bundle
    return bundle


def adjust(
    bundle: Bundle, seen: Sightings, scale_px: float = math.inf, least_gain: float = _SETTLED
) -> Adjusted:
    """Return the poses near those of a bundle that explain the sightings best.

    Args:
        bundle: Poses to begin with.
        seen: The sightings.
        scale_px: Distance from which on a corner coordinate counts less, by the loss
            ``2 s**2 (sqrt(1 + (r / s)**2) - 1)`` [px].
        least_gain: Relative gain of the cost below which no further step is made.

    Raises:
        AdjustmentError: The sightings leave something open.
    """
    residuals, damping = bundle.residuals(seen), _DAMPING
    for _ in range(_STEPS):
        jacobian = bundle.jacobian(seen)
        weights = 1.0 / np.sqrt(1.0 + (residuals / scale_px) ** 2)
        weighted = _weighted_rows(jacobian, weights).T.tocsr()
        normal, gradient, cost = weighted @ jacobian, weighted @ residuals, _cost(residuals, scale_px)
        while True:
            step = -_factorised(normal, damping).solve(gradient)
            settled = -gradient @ step < least_gain * cost
            moved = bundle.moved(step)
            after = moved.residuals(seen)
            better = _cost(after, scale_px) < cost
            if settled or better or damping > _MOST_DAMPING:
                break
            damping *= _FACTOR
        if better:
            bundle, residuals, damping = moved, after, max(damping / _FACTOR, _LEAST_DAMPING)
        if settled or not better:
            jacobian = bundle.jacobian(seen)
            return Adjusted(bundle, residuals, jacobian, _factorised(jacobian.T @ jacobian, 0.0))
    raise AdjustmentError(
        f"the map has not settled after {_STEPS} steps of least squares; a calibration of another camera, "
        "tags that moved between pictures, or an id that several tags have may be why"
    )


def _cost(residuals: Array, scale_px: float) -> float:
    if math.isinf(scale_px):
        return float(residuals @ residuals)
    return float(2.0 * scale_px**2 * (np.sqrt(1.0 + (residuals / scale_px) ** 2) - 1.0).sum())


def _weighted_rows(matrix: csr_array, weights: Array) -> csr_array:
    """Return a matrix whose rows are multiplied by weights, shape (rows,)."""
    data = matrix.data * np.repeat(weights, np.diff(matrix.indptr))
    return csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


def _factorised(normal: csr_array, damping: float) -> SuperLU:
    diagonal = normal.diagonal()
    # A view or a tag that no sighting is left of stays where it is.
    added = np.where(diagonal == 0.0, 1.0, damping * diagonal)
    places = np.arange(len(added) + 1, dtype=np.int32)
    damped = csc_array(normal) + csc_array((added, places[:-1], places), shape=normal.shape)
    try:
        return splu(damped)
    except RuntimeError:
        raise AdjustmentError("the sightings leave a pose of the map open") from None
