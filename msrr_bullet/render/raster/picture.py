"""Pictures on faces: filtered by a pyramid, so that they neither alias nor lose what can be seen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.raster.compiled import inlined, kernel
from msrr_bullet.render.raster.projection import Faces, Indices


class Textures(NamedTuple):
    """All textures, level by level; reflectance 0 to 1."""

    first_level: Indices  # (T,) of each texture
    level_count: Indices  # (T,)
    level_start: Indices  # (L,) in texels
    level_rows: Indices  # (L,)
    level_columns: Indices  # (L,)
    texels: NDArray[np.float32]  # all levels, row by row
    regions: Indices  # of each texel, where the texture has cells: where to find its region's reflectance
    region_grey: NDArray[np.float32]


@kernel
def picture_at(faces: Faces, textures: Textures, f: int, u: float, v: float, w: float) -> float:
    """Return the reflectance of face f at (u, v), where 1 / z = w, filtered over about a pixel."""
    number = faces.texture[f]
    first, count = textures.first_level[number], textures.level_count[number]
    rows, columns = textures.level_rows[first], textures.level_columns[first]
    s_form, t_form, form = faces.uv[f, 0], faces.uv[f, 1], faces.inverse_depth[f]
    s = (s_form[0] * u + (s_form[1] * v + s_form[2])) / w
    t = (t_form[0] * u + (t_form[1] * v + t_form[2])) / w
    # How far one pixel reaches over the picture: derivatives of s = (s / z) / (1 / z).
    su, sv = (s_form[0] - s * form[0]) / w * columns, (s_form[1] - s * form[1]) / w * columns
    tu, tv = (t_form[0] - t * form[0]) / w * rows, (t_form[1] - t * form[1]) / w * rows
    reach = np.sqrt(max(su * su + tu * tu, sv * sv + tv * tv))
    level = min(max(np.log2(max(reach, 1e-9)), 0.0), count - 1.0)
    low = int(level)
    grey = repeated(textures, first + low, s, 1.0 - t)
    if level > low:
        grey += (level - low) * (repeated(textures, first + low + 1, s, 1.0 - t) - grey)
    return grey


@inlined
def repeated(textures: Textures, level: int, s: float, t: float) -> float:
    """Return a level's reflectance at column s and row t (1: the whole picture), bilinear and repeated."""
    rows, columns = textures.level_rows[level], textures.level_columns[level]
    x, y = s * columns - 0.5, t * rows - 0.5
    fx, fy = np.floor(x), np.floor(y)
    ax, ay = x - fx, y - fy
    i0, j0 = int(fx) % columns, int(fy) % rows
    i1, j1 = (i0 + 1) % columns, (j0 + 1) % rows
    upper = textures.level_start[level] + j0 * columns
    lower = textures.level_start[level] + j1 * columns
    texels = textures.texels
    a = texels[upper + i0] + ax * (texels[upper + i1] - texels[upper + i0])
    b = texels[lower + i0] + ax * (texels[lower + i1] - texels[lower + i0])
    return a + ay * (b - a)
