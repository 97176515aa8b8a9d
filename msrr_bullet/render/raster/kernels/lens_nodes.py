"""Where a lens that distorts shows the nodes of a grid of pixels."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import kernel
from msrr_bullet.render.raster.kernels.records import Lens
from msrr_scenes.arrays import Array

#: Steps of Newton's method, and the largest distance, in the plane z = 1, between a node and the image of
#: what was found for it: those of :class:`msrr_scenes.geometry.distortion.Distortion`.
_STEPS, _RESIDUAL = 7, 1e-9


@kernel
def undistort_nodes(
    lens: Lens, columns: Array, rows: Array, j0: int, j1: int, i0: int, i1: int, u: Array, v: Array
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
    invertible = True
    for j in range(j0, j1):
        y_shown = (rows[j] - lens.cy) / lens.focal / lens.aspect
        for i in range(i0, i1):
            x_shown = (columns[i] - lens.cx) / lens.focal
            x, y, ex, ey, determinant = x_shown, y_shown, 0.0, 0.0, 1.0
            for _ in range(_STEPS + 1):
                r2 = x * x + y * y
                radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
                ex = radial * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) - x_shown
                ey = radial * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y - y_shown
                slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
                a = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
                b = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
                d = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
                determinant = a * d - b * b
                if abs(ex) + abs(ey) < 1e-15:
                    break
                x, y = x - (d * ex - b * ey) / determinant, y - (a * ey - b * ex) / determinant
            # Where the polynomial folds the plane the determinant changes its sign; NaN fails, too.
            if not (abs(ex) < _RESIDUAL and abs(ey) < _RESIDUAL and determinant > 0.0):
                invertible = False
            u[j, i], v[j, i] = lens.focal * x + lens.cx + 0.5, lens.focal * y + lens.cy + 0.5
    return invertible


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
