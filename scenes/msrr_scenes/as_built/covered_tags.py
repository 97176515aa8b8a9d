"""Tags that the plate of another one passes through, which no maker leaves so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import tag_corners

#: Distance from the face of a tag to the back of the plate that carries it [m].
_THICK_M = 0.0015


def covered_tags(X_UT: Sequence[SE3], sizes: Array, plate_ratio: float) -> NDArray[np.bool_]:
    """Return for N tags whether the plate of tag j passes through the black square of tag i, shape (N, N).

    Args:
        X_UT: Poses of the tags.
        sizes: Edges of their black squares, shape (N,) [m].
        plate_ratio: Edge of a plate over that of the black square of its tag.
    """
    plates = plate_ratio * sizes
    covered = np.zeros((len(X_UT), len(X_UT)), dtype=np.bool_)
    for depth in (0.0, _THICK_M):
        X_UP = [X @ SE3(np.eye(3), np.array([0.0, 0.0, depth])) for X in X_UT]
        covered |= _pierced(X_UT, sizes, X_UP, plates) | _pierced(X_UP, plates, X_UT, sizes).T
    return covered


def _pierced(X_UT: Sequence[SE3], sizes: Array, X_UP: Sequence[SE3], others: Array) -> NDArray[np.bool_]:
    """Return whether the edge of square j, at ``X_UP`` with edge ``others``, passes through square i."""
    R, p = np.array([X.R for X in X_UT]), np.array([X.p for X in X_UT])
    ends_U = np.array([X.act(tag_corners(float(other))) for X, other in zip(X_UP, others, strict=True)])
    # Ends of the edges of square j in the frame of square i, shape (N, N, 4, 3).
    ends = (ends_U[None] - p[:, None, None]) @ R[:, None]
    along = np.roll(ends, -1, axis=2) - ends
    with np.errstate(divide="ignore", invalid="ignore"):  # of edges that are parallel to the square
        share = -ends[..., 2] / along[..., 2]
        at = np.abs(ends[..., :2] + share[..., None] * along[..., :2]).max(axis=-1)
        pierced = (share > 0.0) & (share < 1.0) & (at < 0.5 * sizes[:, None, None])
    through: NDArray[np.bool_] = pierced.any(axis=2) & ~np.eye(len(X_UT), dtype=np.bool_)
    return through
