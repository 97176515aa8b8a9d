"""Simple pixels, which show one thing only, get their grey level; the others, mixed ones, are listed."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.floor import shade_floor
from msrr_bullet.render.raster.kernels.grid import column_at, middle_column, middle_row, row_at
from msrr_bullet.render.raster.kernels.pixel_map import over_pixel, write_map
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
    PixelGrid,
    ProjectedFaces,
    RowBuffers,
    Samples,
    TexelNumbers,
    Textures,
)
from msrr_bullet.render.raster.kernels.textures import cell_index, filtered_reflectance, mean_of_cells
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

REGION_MASK = (1 << REGION_BITS) - 1


@inlined
def quantised(grey: float) -> np.uint8:
    """Return the nearest of the 256 grey levels."""
    return np.uint8(min(max(grey, 0.0), 255.0) + 0.5)


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
def mean_cells_of_pixel(
    u: Array | int,
    v: Array | int,
    maps: Array,
    p: int,
    k: int,
    i: int,
    uv: Array,
    cells: Indices,
    inverse_depth: Array,
    texels: Floats,
    f: int,
    positions: Floats,
    index: TexelNumbers,
) -> float:
    """Return the mean reflectance of face f's bitmap over a pixel of the list, which shows nothing else."""
    s_form = over_pixel(u, v, maps, p, k, i, uv[f, 0, 0], uv[f, 0, 1], uv[f, 0, 2])
    t_form = over_pixel(u, v, maps, p, k, i, uv[f, 1, 0], uv[f, 1, 1], uv[f, 1, 2])
    a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
    w_form = over_pixel(u, v, maps, p, k, i, a, b, c)
    return mean_of_cells(cells, texels, f, s_form, t_form, w_form, positions, index)


@inlined
def mean_surface_grey(
    u: Array | int,
    v: Array | int,
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
    # The slopes below are those along the sides of a pixel of an ideal lens, which are 1.
    side = max(column_at(u, k, i + 1) - column_at(u, k, i), row_at(v, k + 1, i) - row_at(v, k, i))
    total = 0.0
    for n in range(4):
        row, column = n // 2, i + n % 2
        g = identity[j + row, column] >> REGION_BITS
        x, y = column_at(u, k + row, column), row_at(v, k + row, column)
        w = np.float64(depth[j + row, column])
        # One part of the surface may hide another: then there is a step, more than the slopes explain.
        step = abs(w - (a * x + (b * y + c)))
        slopes = side * (abs(a) + abs(b) + abs(inverse_depth[g, 0]) + abs(inverse_depth[g, 1]))
        if g < 0 or kind[g] != SMOOTH or surface[g] != surface[f] or step > 0.5 * slopes + 1e-4 * w:
            total = -np.inf
        else:
            total += (shade[g, 0] * x + (shade[g, 1] * y + shade[g, 2])) / w
    return max(0.25 * total, -1.0)


@subroutine
def shade_simple_pixels(
    grid: PixelGrid,
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
    out: Pixels,
) -> None:
    """Write the simple pixels of a band of rows and list the mixed ones.

    A pixel is simple if its four corners show the same and no edge may cross it, so such pixels come in runs
    of one identity. Two more kinds of pixels are treated as simple: where all corners show one bitmap, it
    fills the pixel, and is sampled without depth; where they show one round surface, the pixel gets the mean
    of what its corners show.

    Args:
        grid: Corners of the window's pixels.
        top: First row of the band in the window.
        height: Number of rows of the band.
        faces: The faces in view.
        textures: Textures of the faces.
        floor_texture: Texture of the floor.
        floor_view: The floor seen from the camera.
        corners: Corners of the band's pixels, with all faces drawn.
        row_buffers: Memory for one row.
        cell_positions: Positions of the samples of cells in a pixel.
        samples: Its lists of mixed pixels are filled.
        out: Pixels of the band, shape (height, width).
    """
    u, v, depth, identity = grid.u, grid.v, corners.depth, corners.identity
    start, column, maps = samples.start, samples.column, samples.maps
    flags, texel = row_buffers.flags, row_buffers.texel
    kind, grey, shade, inverse_depth = faces.kind, faces.grey, faces.shade, faces.inverse_depth
    cells, uv, texture, surface = faces.cells, faces.uv, faces.texture, faces.surface
    level_start, levels, texels = textures.level_start, textures.levels, textures.texels
    region_grey, words = textures.region_grey, flags.view(np.uint64)
    count = 0
    for j in range(height):
        start[j] = count
        flag_row(depth, identity, corners.edge_depth, j, grid.width, flags)
        k = top + j
        i = 0
        while i < grid.width:
            first = i
            while i < grid.width and flags[i] == 0:
                if i % 8 == 0 and words[i // 8] == 0:
                    i += 8
                else:
                    i += 1
            i = min(i, grid.width)
            if first < i:
                name = identity[j, first]
                f = name >> REGION_BITS
                value = floor_texture.wall
                if name >= 0 and kind[f] == 0:
                    value = grey[f]
                elif name >= 0 and kind[f] == TEXTURED | CELLS:
                    value = grey[f] * region_grey[cells[f, 3] + (name & REGION_MASK)]
                elif name == FLOOR:
                    shade_floor(grid, floor_texture, floor_view, row_buffers, out[j], k, first, i)
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
                            float(np.float32(middle_column(u, k, n))),
                            float(np.float32(middle_row(v, k, n))),
                        )
                        out[j, n] = quantised(value)
                    continue
                for n in range(first, i):
                    out[j, n] = quantised(value)
            while i < grid.width and flags[i] != 0:
                write_map(u, v, maps, count, k, i)
                mean, f = -1.0, identity[j, i] >> REGION_BITS
                if flags[i] == 1 and f >= 0:
                    if kind[f] == SMOOTH:
                        mean = mean_surface_grey(
                            u, v, k, inverse_depth, shade, surface, kind, depth, identity, j, i
                        )
                    elif kind[f] == TEXTURED | CELLS and (
                        f
                        == identity[j, i + 1] >> REGION_BITS
                        == identity[j + 1, i] >> REGION_BITS
                        == identity[j + 1, i + 1] >> REGION_BITS
                    ):
                        mean = grey[f] * mean_cells_of_pixel(
                            u,
                            v,
                            maps,
                            count,
                            k,
                            i,
                            uv,
                            cells,
                            inverse_depth,
                            texels,
                            f,
                            cell_positions,
                            texel,
                        )
                if mean >= 0.0:
                    out[j, i] = quantised(mean)
                else:
                    column[count] = i
                    count += 1
                i += 1
    start[height] = count


@subroutine
def flag_row(
    depth: Floats, identity: Identities, edge_depth: Floats, j: int, width: int, flags: Pixels
) -> None:
    """Flag the pixels of row ``j`` whose corners differ (1) and that a nearer edge may cross (2)."""
    for i in range(width):
        name = identity[j, i]
        differs = (name ^ identity[j, i + 1]) | (name ^ identity[j + 1, i]) | (name ^ identity[j + 1, i + 1])
        least = min(min(depth[j, i], depth[j, i + 1]), min(depth[j + 1, i], depth[j + 1, i + 1]))
        flags[i] = 2 * (edge_depth[j, i] > least) + (differs != 0)
