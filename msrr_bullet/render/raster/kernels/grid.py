"""The corners and middles of the pixels of a window, in the image of an ideal lens.

Behind a lens that distorts they are looked up. Behind an ideal one they are whole numbers and halves, which
take no memory. The functions here choose by the type of what they are given, which is known when a kernel is
compiled, so that the same source becomes a kernel for each kind of lens.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import chosen_by_type, inlined
from msrr_scenes.arrays import Array

#: Pixels of a row that share one blend of the floor, aligned to the frame.
GROUP = 32


def _is_array(kind: Any) -> bool:
    """Say whether an argument, or numba's type of it, is an array."""
    return hasattr(kind, "ndim")


@chosen_by_type
def distorts(u: Any) -> Any:
    """Say whether the lens distorts; ``u`` is that of :class:`.records.PixelGrid`."""
    if _is_array(u):
        return lambda u: True
    return lambda u: False


@chosen_by_type
def column_at(u: Any, j: Any, i: Any) -> Any:
    """Return the column of corner (j, i) of the window; ``u`` is that of :class:`.records.PixelGrid`."""
    if _is_array(u):
        return lambda u, j, i: u[j, i]
    # Of 32 bits, so that loops over i become vector code.
    return lambda u, j, i: np.float64(np.int32(u + np.int64(i)))


@chosen_by_type
def row_at(v: Any, j: Any, i: Any) -> Any:
    """Return the row of corner (j, i); ``v`` is that of :class:`.records.PixelGrid`."""
    if _is_array(v):
        return lambda v, j, i: v[j, i]
    return lambda v, j, i: np.float64(np.int32(v + np.int64(j)))


@inlined
def form_at(a: float, b: float, c: float, u: Array | int, v: Array | int, j: int, i: int) -> float:
    """Return the value of the form (a, b, c) at corner (j, i)."""
    return a * column_at(u, j, i) + (b * row_at(v, j, i) + c)


@chosen_by_type
def middle_column(u: Any, j: Any, i: Any) -> Any:
    """Return the column of the middle of pixel (j, i): the mean of its corners."""
    if _is_array(u):
        return lambda u, j, i: 0.25 * ((u[j, i] + u[j, i + 1]) + (u[j + 1, i] + u[j + 1, i + 1]))
    return lambda u, j, i: np.float64(np.int32(u + np.int64(i))) + 0.5


@chosen_by_type
def middle_row(v: Any, j: Any, i: Any) -> Any:
    """Return the row of the middle of pixel (j, i)."""
    if _is_array(v):
        return lambda v, j, i: 0.25 * ((v[j, i] + v[j, i + 1]) + (v[j + 1, i] + v[j + 1, i + 1]))
    return lambda v, j, i: np.float64(np.int32(v + np.int64(j))) + 0.5


@chosen_by_type
def bound_at(bounds: Any, j: Any) -> Any:
    """Return the least or greatest row of the corners (j, .)."""
    if _is_array(bounds):
        return lambda bounds, j: bounds[j]
    return lambda bounds, j: np.float64(bounds + j)


@chosen_by_type
def group_column(group_u: Any, j: Any, group: Any) -> Any:
    """Return the column of the middle of a group of pixels of row j."""
    if _is_array(group_u):
        return lambda group_u, j, group: group_u[j, group]
    return lambda group_u, j, group: group_u + np.float64(GROUP * group)


@chosen_by_type
def group_row(group_v: Any, j: Any, group: Any) -> Any:
    """Return its row."""
    if _is_array(group_v):
        return lambda group_v, j, group: group_v[j, group]
    return lambda group_v, j, group: group_v + np.float64(j)
