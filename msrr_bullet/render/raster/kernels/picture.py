"""Pictures on faces: filtered by a pyramid, so that they neither alias nor lose what can be seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.raster.kernels.compiled import inlined, kernel
from msrr_bullet.render.raster.kernels.records import Indices
from msrr_scenes.arrays import Array


@kernel
def picture_at(
    inverse_depth: Array,
    uv: Array,
    texture: Indices,
    first_level: Indices,
    level_count: Indices,
    level_start: Indices,
    level_rows: Indices,
    level_columns: Indices,
    texels: NDArray[np.float32],
    f: int,
    u: float,
    v: float,
) -> float:
    """Return the reflectance of face f's picture at (u, v), filtered over about a pixel.

    The arrays are those of :class:`Faces` and :class:`Textures`; one by one, they are not counted.
    """
    first, count = first_level[texture[f]], level_count[texture[f]]
    rows, columns = level_rows[first], level_columns[first]
    wu, wv = inverse_depth[f, 0], inverse_depth[f, 1]
    z = 1.0 / (wu * u + (wv * v + inverse_depth[f, 2]))
    s = (uv[f, 0, 0] * u + (uv[f, 0, 1] * v + uv[f, 0, 2])) * z
    t = (uv[f, 1, 0] * u + (uv[f, 1, 1] * v + uv[f, 1, 2])) * z
    # How far one pixel reaches over the picture: derivatives of s = (s / z) / (1 / z).
    su, sv = (uv[f, 0, 0] - s * wu) * z * columns, (uv[f, 0, 1] - s * wv) * z * columns
    tu, tv = (uv[f, 1, 0] - t * wu) * z * rows, (uv[f, 1, 1] - t * wv) * z * rows
    reach = np.sqrt(max(su * su + tu * tu, sv * sv + tv * tv))
    level = min(max(np.log2(max(reach, 1e-9)), 0.0), count - 1.0)
    fine = first + int(level)
    coarse = min(fine + 1, first + count - 1)
    below = repeated(texels, level_start[fine], level_rows[fine], level_columns[fine], s, 1.0 - t)
    above = repeated(texels, level_start[coarse], level_rows[coarse], level_columns[coarse], s, 1.0 - t)
    return below + (level - int(level)) * (above - below)


@inlined
def repeated(texels: NDArray[np.float32], start: int, rows: int, columns: int, s: float, t: float) -> float:
    """Return a level's reflectance at column s and row t (1: the whole picture), bilinear and repeated.

    Rows and columns are powers of two.
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
