"""Simple pixels behind a lens that distorts get their grey level; the others are listed with their maps.

The samples of a pixel are placed by the affine map that fits its four corners best: a form over the image of
the ideal lens becomes a form over the unit square of the pixel.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.lens_floor import middle_of, shade_lens_floor
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    SMOOTH,
    TEXTURED,
    Corners,
    Floats,
    FloorTexture,
    FloorView,
    Identities,
    Indices,
    LensView,
    ProjectedFaces,
    RowBuffers,
    Samples,
    TexelNumbers,
    Textures,
)
from msrr_bullet.render.raster.kernels.simple_pixels import REGION_MASK, flag_row, quantised
from msrr_bullet.render.raster.kernels.textures import cell_index, filtered_reflectance, mean_of_cells
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels


@inlined
def face_grey_at(
    kind: Indices,
    grey: Array,
    shade: Array,
    inverse_depth: Array,
    cells: Indices,
    uv: Array,
    texture: Indices,
    level_start: Indices,
    levels: Indices,
    texels: Floats,
    f: int,
    u: float,
    v: float,
) -> float:
    """Return the grey level of face f at a point of the image of the ideal lens.

    The arrays are those of :class:`ProjectedFaces` and :class:`Textures`, passed one by one because numba
    counts references to the arrays of a tuple.
    """
    value = grey[f]
    w = inverse_depth[f, 0] * u + (inverse_depth[f, 1] * v + inverse_depth[f, 2])
    if kind[f] & SMOOTH:
        value = (shade[f, 0] * u + (shade[f, 1] * v + shade[f, 2])) / w
    if kind[f] & CELLS:
        value *= texels[cell_index(uv, cells, f, u, v, w)]
    elif kind[f] & TEXTURED:
        value *= filtered_reflectance(inverse_depth, uv, texture, level_start, levels, texels, f, u, v)
    return value


@inlined
def pulled_back(a: float, b: float, c: float, maps: Array, p: int) -> tuple[float, float, float]:
    """Return a form over the image as a form over the unit square of mixed pixel p."""
    x = a * maps[p, 2] + b * maps[p, 3]
    y = a * maps[p, 4] + b * maps[p, 5]
    return x, y, a * maps[p, 0] + (b * maps[p, 1] + c)


@inlined
def mean_cells_of_pixel(
    uv: Array,
    cells: Indices,
    inverse_depth: Array,
    texels: Floats,
    f: int,
    maps: Array,
    p: int,
    positions: Floats,
    index: TexelNumbers,
) -> float:
    """Return the mean reflectance of face f's bitmap over mixed pixel p, which shows nothing else."""
    s_form = pulled_back(uv[f, 0, 0], uv[f, 0, 1], uv[f, 0, 2], maps, p)
    t_form = pulled_back(uv[f, 1, 0], uv[f, 1, 1], uv[f, 1, 2], maps, p)
    w_form = pulled_back(inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2], maps, p)
    return mean_of_cells(cells, texels, f, s_form, t_form, w_form, positions, index)


@inlined
def mean_surface_grey_at(
    u: Array,
    v: Array,
    k: int,
    inverse_depth: Array,
    shade: Array,
    surface: Indices,
    kind: Indices,
    depth: Floats,
    identity: Identities,
    j: int,
    i: int,
) -> float:
    """Return the mean grey level of a pixel's corners if they lie on one unbroken round surface, else -1."""
    f = identity[j, i] >> REGION_BITS
    a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
    # A side of the pixel, for that of a plain one, is 1.
    side = max(u[k, i + 1] - u[k, i], v[k + 1, i] - v[k, i])
    total = 0.0
    for n in range(4):
        row, column = n // 2, i + n % 2
        g = identity[j + row, column] >> REGION_BITS
        x, y, w = u[k + row, column], v[k + row, column], np.float64(depth[j + row, column])
        # One part of the surface may hide another: then there is a step, more than the slopes explain.
        step = abs(w - (a * x + (b * y + c)))
        slopes = side * (abs(a) + abs(b) + abs(inverse_depth[g, 0]) + abs(inverse_depth[g, 1]))
        if g < 0 or kind[g] != SMOOTH or surface[g] != surface[f] or step > 0.5 * slopes + 1e-4 * w:
            total = -np.inf
        else:
            total += (shade[g, 0] * x + (shade[g, 1] * y + shade[g, 2])) / w
    return max(0.25 * total, -1.0)


@subroutine
def shade_lens_simple_pixels(
    view: LensView,
    top: int,
    height: int,
    faces: ProjectedFaces,
    textures: Textures,
    floor_texture: FloorTexture,
    floor_view: FloorView,
    corners: Corners,
    row_buffers: RowBuffers,
    cell_positions: Floats,
    samples: Samples,
    maps: Array,
    out: Pixels,
) -> None:
    """Write the pixels of a band of rows that show one thing only, and list the others with their maps.

    Treated as simple are those that :func:`.simple_pixels.shade_simple_pixels` names. ``maps``, shape (P, 6),
    gets the place (u, v) of each listed pixel's upper left corner, and how u and v change along its columns
    and along its rows.
    """
    u, v, depth, identity = view.u, view.v, corners.depth, corners.identity
    start, column, flags, texel = samples.start, samples.column, row_buffers.flags, row_buffers.texel
    kind, grey, shade, inverse_depth = faces.kind, faces.grey, faces.shade, faces.inverse_depth
    cells, uv, texture, surface = faces.cells, faces.uv, faces.texture, faces.surface
    level_start, levels, texels = textures.level_start, textures.levels, textures.texels
    region_grey, words = textures.region_grey, flags.view(np.uint64)
    width = u.shape[1] - 1
    count = 0
    for j in range(height):
        start[j] = count
        flag_row(depth, identity, corners.edge_depth, j, width, flags)
        k = top + j
        i = 0
        while i < width:
            first = i
            while i < width and flags[i] == 0:
                if i % 8 == 0 and words[i // 8] == 0:
                    i += 8
                else:
                    i += 1
            i = min(i, width)
            if first < i:
                name = identity[j, first]
                f = name >> REGION_BITS
                value = floor_texture.wall
                if name >= 0 and kind[f] == 0:
                    value = grey[f]
                elif name >= 0 and kind[f] == TEXTURED | CELLS:
                    value = grey[f] * region_grey[cells[f, 3] + (name & REGION_MASK)]
                elif name == FLOOR:
                    shade_lens_floor(view, floor_texture, floor_view, row_buffers, out[j], k, first, i)
                    continue
                elif name >= 0:
                    for n in range(first, i):
                        value = face_grey_at(
                            kind,
                            grey,
                            shade,
                            inverse_depth,
                            cells,
                            uv,
                            texture,
                            level_start,
                            levels,
                            texels,
                            f,
                            float(np.float32(middle_of(u, k, n))),
                            float(np.float32(middle_of(v, k, n))),
                        )
                        out[j, n] = quantised(value)
                    continue
                for n in range(first, i):
                    out[j, n] = quantised(value)
            while i < width and flags[i] != 0:
                ux = 0.5 * ((u[k, i + 1] - u[k, i]) + (u[k + 1, i + 1] - u[k + 1, i]))
                vx = 0.5 * ((v[k, i + 1] - v[k, i]) + (v[k + 1, i + 1] - v[k + 1, i]))
                uy = 0.5 * ((u[k + 1, i] - u[k, i]) + (u[k + 1, i + 1] - u[k, i + 1]))
                vy = 0.5 * ((v[k + 1, i] - v[k, i]) + (v[k + 1, i + 1] - v[k, i + 1]))
                maps[count, 0] = middle_of(u, k, i) - 0.5 * (ux + uy)
                maps[count, 1] = middle_of(v, k, i) - 0.5 * (vx + vy)
                maps[count, 2], maps[count, 3], maps[count, 4], maps[count, 5] = ux, vx, uy, vy
                mean, f = -1.0, identity[j, i] >> REGION_BITS
                if flags[i] == 1 and f >= 0:
                    if kind[f] == SMOOTH:
                        mean = mean_surface_grey_at(
                            u, v, k, inverse_depth, shade, surface, kind, depth, identity, j, i
                        )
                    elif kind[f] == TEXTURED | CELLS and (
                        f
                        == identity[j, i + 1] >> REGION_BITS
                        == identity[j + 1, i] >> REGION_BITS
                        == identity[j + 1, i + 1] >> REGION_BITS
                    ):
                        mean = grey[f] * mean_cells_of_pixel(
                            uv, cells, inverse_depth, texels, f, maps, count, cell_positions, texel
                        )
                if mean >= 0.0:
                    out[j, i] = quantised(mean)
                else:
                    column[count] = i
                    count += 1
                i += 1
    start[height] = count
