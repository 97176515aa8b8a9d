"""Textures on faces: filtered lookups in images, and exact lookups in the cells of bitmaps such as tags."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.grid import form_at
from msrr_bullet.render.raster.kernels.records import Floats, Indices, TexelNumbers
from msrr_bullet.render.raster.kernels.sample_positions import CELL_SAMPLES
from msrr_scenes.arrays import Array


@subroutine
def filtered_reflectance(
    inverse_depth: Array,
    uv: Array,
    texture: Indices,
    level_start: Indices,
    levels: Indices,
    texels: Floats,
    f: int,
    u: float,
    v: float,
) -> float:
    """Return the reflectance of the image on face f at (u, v), filtered over about a pixel.

    The arrays are those of :class:`ProjectedFaces` and :class:`Textures`, passed one by one because numba
    counts references to the arrays of a tuple.
    """
    first, end = level_start[texture[f]], level_start[texture[f] + 1]
    rows, columns = levels[first, 1], levels[first, 2]
    wu, wv = inverse_depth[f, 0], inverse_depth[f, 1]
    # The middle of a mixed pixel may lie on the horizon of the face's plane, or beyond.
    z = 1.0 / max(wu * u + (wv * v + inverse_depth[f, 2]), 1e-6)
    s = (uv[f, 0, 0] * u + (uv[f, 0, 1] * v + uv[f, 0, 2])) * z
    t = (uv[f, 1, 0] * u + (uv[f, 1, 1] * v + uv[f, 1, 2])) * z
    # How far one pixel reaches over the image: derivatives of s = (s / z) / (1 / z).
    su, sv = (uv[f, 0, 0] - s * wu) * z * columns, (uv[f, 0, 1] - s * wv) * z * columns
    tu, tv = (uv[f, 1, 0] - t * wu) * z * rows, (uv[f, 1, 1] - t * wv) * z * rows
    reach = np.sqrt(max(su * su + tu * tu, sv * sv + tv * tv))
    level = min(max(np.log2(max(reach, 1e-9)), 0.0), end - first - 1.0)
    fine = first + int(level)
    coarse = min(fine + 1, end - 1)
    below = bilinear_reflectance(texels, levels[fine, 0], levels[fine, 1], levels[fine, 2], s, 1.0 - t)
    above = bilinear_reflectance(texels, levels[coarse, 0], levels[coarse, 1], levels[coarse, 2], s, 1.0 - t)
    return below + (level - int(level)) * (above - below)


@inlined
def bilinear_reflectance(texels: Floats, start: int, rows: int, columns: int, s: float, t: float) -> float:
    """Return a level's reflectance at column s and row t of the repeated image (1: its whole edge).

    The numbers of rows and columns are powers of two.
    """
    x, y = s * columns - 0.5, t * rows - 0.5
    fx, fy = np.floor(x), np.floor(y)
    ax, ay = x - fx, y - fy
    i0, j0 = int(fx) & (columns - 1), int(fy) & (rows - 1)
    i1, j1 = (i0 + 1) & (columns - 1), (j0 + 1) & (rows - 1)
    upper, lower = start + j0 * columns, start + j1 * columns
    a = texels[upper + i0] + ax * (texels[upper + i1] - texels[upper + i0])
    b = texels[lower + i0] + ax * (texels[lower + i1] - texels[lower + i0])
    return a + ay * (b - a)


@inlined
def cell_index(uv: Array, cells: Indices, f: int, u: float, v: float, w: float) -> int:
    """Return the index of the texel of face f's bitmap at (u, v), where 1 / z = w."""
    rows, columns = cells[f, 1], cells[f, 2]
    z = 1.0 / w
    s = (uv[f, 0, 0] * u + (uv[f, 0, 1] * v + uv[f, 0, 2])) * z
    t = (uv[f, 1, 0] * u + (uv[f, 1, 1] * v + uv[f, 1, 2])) * z
    column = min(max(int(np.floor(s * columns)), 0), columns - 1)
    row = min(max(int(np.floor((1.0 - t) * rows)), 0), rows - 1)
    return cells[f, 0] + row * columns + column


@inlined
def write_cell_indices(
    u: Array | int,
    v: Array | int,
    uv: Array,
    cells: Indices,
    f: int,
    a: float,
    b: float,
    c: float,
    k: int,
    i0: int,
    i1: int,
    out: TexelNumbers,
) -> None:
    """Write the indices of the texels of face f's bitmap at corners i0 to i1 of row k.

    The inverse depth has the form (a, b, c). Apart from the loop that asks whether they are seen, this
    becomes vector code.
    """
    start, rows, columns = np.int32(cells[f, 0]), np.int32(cells[f, 1]), np.int32(cells[f, 2])
    last_row, last_column = np.int32(rows - 1), np.int32(columns - 1)
    sa, sb, sc = uv[f, 0, 0], uv[f, 0, 1], uv[f, 0, 2]
    ta, tb, tc = uv[f, 1, 0], uv[f, 1, 1], uv[f, 1, 2]
    for i in range(np.uint32(i0), np.uint32(i1)):
        z = 1.0 / form_at(a, b, c, u, v, k, i)
        column = np.int32(form_at(sa, sb, sc, u, v, k, i) * z * columns)
        line = np.int32((1.0 - form_at(ta, tb, tc, u, v, k, i) * z) * rows)
        column = min(max(column, np.int32(0)), last_column)
        line = min(max(line, np.int32(0)), last_row)
        out[i] = start + line * columns + column


@inlined
def mean_of_cells(
    cells: Indices,
    texels: Floats,
    f: int,
    s_form: tuple[float, float, float],
    t_form: tuple[float, float, float],
    w_form: tuple[float, float, float],
    positions: Floats,
    index: TexelNumbers,
) -> float:
    """Return the mean reflectance of face f's bitmap over a pixel, given by forms over its unit square.

    The forms are those of both texture coordinates over z, and of 1 / z.
    """
    sa, sb, s0 = np.float32(s_form[0]), np.float32(s_form[1]), np.float32(s_form[2])
    ta, tb, t0 = np.float32(t_form[0]), np.float32(t_form[1]), np.float32(t_form[2])
    wa, wb, w0 = np.float32(w_form[0]), np.float32(w_form[1]), np.float32(w_form[2])
    start, rows, columns = np.int32(cells[f, 0]), np.int32(cells[f, 1]), np.int32(cells[f, 2])
    last_row, last_column = np.int32(rows - 1), np.int32(columns - 1)
    for s in range(CELL_SAMPLES):
        px, py = positions[0, s], positions[1, s]
        z = np.float32(1.0) / (w0 + (wa * px + wb * py))
        column = np.int32((s0 + (sa * px + sb * py)) * z * np.float32(columns))
        row = np.int32((np.float32(1.0) - (t0 + (ta * px + tb * py)) * z) * np.float32(rows))
        column = min(max(column, np.int32(0)), last_column)
        row = min(max(row, np.int32(0)), last_row)
        index[s] = start + row * columns + column
    total = np.float32(0.0)
    for s in range(CELL_SAMPLES):
        total += texels[index[s]]
    return float(total) / CELL_SAMPLES
