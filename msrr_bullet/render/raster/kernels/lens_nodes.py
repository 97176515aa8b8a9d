"""Where a lens that distorts shows the nodes of a grid of pixels."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import kernel
from msrr_bullet.render.raster.kernels.records import LensParameters
from msrr_scenes.arrays import Array

#: Steps of Newton's method, and the largest distance, in the plane z = 1, between a node and the image of
#: what was found for it: those of :class:`msrr_scenes.geometry.distortion.Distortion`.
_STEPS, _RESIDUAL = 7, 1e-9


@kernel
def undistort_nodes(
    lens: LensParameters, columns: Array, rows: Array, j0: int, j1: int, i0: int, i1: int, u: Array, v: Array
) -> bool:
    """Write where an ideal lens would show a part of a grid of pixels; say whether the lens has an inverse.

    It is :meth:`~msrr_scenes.geometry.distortion.Distortion.ideal_pixels`, compiled. Each node's result is a
    function of that node alone.

    Args:
        lens: Intrinsics and distortion.
        columns: Columns of the nodes, shape (C,) [px].
        rows: Rows of the nodes, shape (R,) [px].
        j0: First row of the part.
        j1: Row after its last.
        i0: First column of the part.
        i1: Column after its last.
        u: Columns in the image of the ideal lens, counted from the edge of the frame, shape (R, C) [px].
        v: Rows, likewise.
    """
    k1, k2, k3, p1, p2 = lens.k1, lens.k2, lens.k3, lens.p1, lens.p2
    x_shown, x, y = np.empty(i1 - i0), np.empty(i1 - i0), np.empty(i1 - i0)
    folded = 0
    for j in range(j0, j1):
        y_shown = (rows[j] - lens.cy) / lens.focal / lens.aspect
        for i in range(i1 - i0):
            x_shown[i] = (columns[i0 + i] - lens.cx) / lens.focal
            x[i], y[i] = x_shown[i], y_shown
        for step in range(_STEPS + 1):  # the last one is only looked at
            for i in range(i1 - i0):  # becomes vector code
                here, there = x[i], y[i]
                r2 = here * here + there * there
                radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
                ex = radial * here + 2.0 * p1 * here * there + p2 * (r2 + 2.0 * here * here) - x_shown[i]
                ey = radial * there + p1 * (r2 + 2.0 * there * there) + 2.0 * p2 * here * there - y_shown
                slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
                a = radial + slope * here * here + 2.0 * p1 * there + 6.0 * p2 * here
                b = slope * here * there + 2.0 * p1 * here + 2.0 * p2 * there
                d = radial + slope * there * there + 6.0 * p1 * there + 2.0 * p2 * here
                determinant = a * d - b * b
                if step < _STEPS:
                    x[i] = here - (d * ex - b * ey) / determinant
                    y[i] = there - (a * ey - b * ex) / determinant
                else:
                    # Where the polynomial folds the plane the determinant changes its sign; NaN fails, too.
                    found = (abs(ex) < _RESIDUAL) & (abs(ey) < _RESIDUAL) & (determinant > 0.0)
                    folded += 0 if found else 1
        for i in range(i1 - i0):
            u[j, i0 + i], v[j, i0 + i] = lens.focal * x[i] + lens.cx + 0.5, lens.focal * y[i] + lens.cy + 0.5
    return folded == 0


@kernel
def node_steps(u: Array, v: Array, j0: int, j1: int, i0: int, i1: int) -> tuple[float, float, float]:
    """Return how the nodes of a part change from one to the next.

    They are the most that u changes by down a column, and the least that u and the most that v changes by
    along a row. The part is given as in :func:`undistort_nodes`.
    """
    shift, pitch, slant = 0.0, np.inf, 0.0
    for j in range(j0, j1):
        for i in range(i0, i1):
            if j > j0:
                shift = max(shift, abs(u[j, i] - u[j - 1, i]))
            if i > i0:
                pitch = min(pitch, u[j, i] - u[j, i - 1])
                slant = max(slant, abs(v[j, i] - v[j, i - 1]))
    return shift, pitch, slant


@kernel
def cut_nodes(
    u: Array, v: Array, top: int, left: int, u_out: Array, v_out: Array, v_low: Array, v_high: Array
) -> None:
    """Copy the part of a grid of nodes that begins at (top, left); write least and greatest v of each row.

    Args:
        u: Columns in the image of the ideal lens, shape (R, C) [px].
        v: Rows, likewise.
        top: First row of the part.
        left: Its first column.
        u_out: Copy of ``u``, shape (r, c).
        v_out: Copy of ``v``, likewise.
        v_low: Least ``v`` of each row of the part, shape (r,).
        v_high: Greatest, likewise.
    """
    for j in range(u_out.shape[0]):
        low, high = np.inf, -np.inf
        for i in range(u_out.shape[1]):
            u_out[j, i] = u[top + j, left + i]
            place = v[top + j, left + i]
            v_out[j, i] = place
            low, high = min(low, place), max(high, place)
        v_low[j], v_high[j] = low, high
