"""The map from a pixel's unit square to the image of an ideal lens.

It is the affine map that fits the four corners of the pixel best: a form over the image becomes a form over
the unit square, in which the samples of the pixel have fixed positions. Where the lens is ideal the map is a
shift, and is not stored.

Pixel (k, i) of the window is number p of the list of mixed pixels; ``u`` and ``v`` are those of
:class:`.records.PixelGrid`, ``maps`` those of :class:`.records.Samples`. A row of ``maps`` holds the place
(u, v) of the pixel's upper left corner, and how u and v change along the pixel's columns and along its rows.
"""

from __future__ import annotations

from msrr_bullet.render.raster.kernels.compiler import inlined
from msrr_bullet.render.raster.kernels.grid import (
    column_at,
    distorts,
    form_at,
    middle_column,
    middle_row,
    row_at,
)
from msrr_scenes.arrays import Array


@inlined
def write_map(u: Array | int, v: Array | int, maps: Array, p: int, k: int, i: int) -> None:
    """Write the map of a pixel."""
    if distorts(u):
        u0, u1 = column_at(u, k, i), column_at(u, k, i + 1)
        v0, v1 = row_at(v, k, i), row_at(v, k, i + 1)
        u2, u3 = column_at(u, k + 1, i), column_at(u, k + 1, i + 1)
        v2, v3 = row_at(v, k + 1, i), row_at(v, k + 1, i + 1)
        ux, vx = 0.5 * ((u1 - u0) + (u3 - u2)), 0.5 * ((v1 - v0) + (v3 - v2))
        uy, vy = 0.5 * ((u2 - u0) + (u3 - u1)), 0.5 * ((v2 - v0) + (v3 - v1))
        maps[p, 0] = middle_column(u, k, i) - 0.5 * (ux + uy)
        maps[p, 1] = middle_row(v, k, i) - 0.5 * (vx + vy)
        maps[p, 2], maps[p, 3], maps[p, 4], maps[p, 5] = ux, vx, uy, vy


@inlined
def over_pixel(
    u: Array | int, v: Array | int, maps: Array, p: int, k: int, i: int, a: float, b: float, c: float
) -> tuple[float, float, float]:
    """Return the form (a, b, c) over the image as a form over the unit square of the pixel."""
    if distorts(u):
        x, y = a * maps[p, 2] + b * maps[p, 3], a * maps[p, 4] + b * maps[p, 5]
        return x, y, a * maps[p, 0] + (b * maps[p, 1] + c)
    return a, b, form_at(a, b, c, u, v, k, i)


@inlined
def place_in_pixel(
    u: Array | int, v: Array | int, maps: Array, p: int, k: int, i: int, x: float, y: float
) -> tuple[float, float]:
    """Return where the point (x, y) of the unit square of the pixel lies in the image."""
    if distorts(u):
        column = maps[p, 0] + (maps[p, 2] * x + maps[p, 4] * y)
        return column, maps[p, 1] + (maps[p, 3] * x + maps[p, 5] * y)
    return column_at(u, k, i) + x, row_at(v, k, i) + y


@inlined
def columns_of_pixel(u: Array | int, maps: Array, p: int, k: int, i: int) -> tuple[float, float]:
    """Return the least and the greatest column that the pixel has in the image."""
    if distorts(u):
        return maps[p, 0] + min(maps[p, 4], 0.0), maps[p, 0] + maps[p, 2] + max(maps[p, 4], 0.0)
    return column_at(u, k, i), column_at(u, k, i) + 1.0
