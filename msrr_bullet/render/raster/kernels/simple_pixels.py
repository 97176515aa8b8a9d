"""Simple pixels, which show one thing only, get its grey level; the others, mixed ones, are listed."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.floor import shade_floor
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
    ProjectedFaces,
    RowBuffers,
    Samples,
    Textures,
    View,
)
from msrr_bullet.render.raster.kernels.textures import cell_index, filtered_reflectance, mean_cell_reflectance
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

REGION_MASK = (1 << REGION_BITS) - 1


@inlined
def quantised(grey: float) -> np.uint8:
    """Return the nearest of the 256 grey levels."""
    return np.uint8(min(max(grey, 0.0), 255.0) + 0.5)


@subroutine
def shade_simple_pixels(
    view: View,
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
    """Write the simple pixels and list the mixed ones.

    A pixel is simple if its four corners show the same and no edge may cross it, so such pixels come in runs
    of one identity. Two more kinds of pixels are treated as simple: where all corners show one bitmap, it
    fills the pixel, and is sampled without depth; where they show one round surface, the pixel gets the mean
    of what its corners show.

    Args:
        view: Camera and band of the window.
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
    depth, identity, edge_depth = corners.depth, corners.identity, corners.edge_depth
    kind, grey, cells, region_grey = faces.kind, faces.grey, faces.cells, textures.region_grey
    uv, inverse_depth, texels = faces.uv, faces.inverse_depth, textures.texels
    shade, surface = faces.shade, faces.surface
    texture, level_start, levels = faces.texture, textures.level_start, textures.levels
    start, column = samples.start, samples.column
    flags, texel = row_buffers.flags, row_buffers.texel
    words = flags.view(np.uint64)
    count = 0
    for j in range(view.height):
        start[j] = count
        flag_row(depth, identity, edge_depth, j, view.width, flags)
        i = 0
        while i < view.width:
            first = i
            while i < view.width and flags[i] == 0:
                if i % 8 == 0 and words[i // 8] == 0:
                    i += 8
                else:
                    i += 1
            i = min(i, view.width)
            if first < i:
                name = identity[j, first]
                f = name >> REGION_BITS
                value = floor_texture.wall
                if name >= 0 and kind[f] == 0:
                    value = grey[f]
                elif name >= 0 and kind[f] == TEXTURED | CELLS:
                    value = grey[f] * region_grey[cells[f, 3] + (name & REGION_MASK)]
                elif name == FLOOR:
                    shade_floor(view, floor_texture, floor_view, row_buffers, out, j, first, i)
                    continue
                elif name >= 0 and kind[f] == SMOOTH:
                    v = view.y + j + 0.5
                    a, b = shade[f, 0], shade[f, 1] * v + shade[f, 2]
                    c, d = inverse_depth[f, 0], inverse_depth[f, 1] * v + inverse_depth[f, 2]
                    for k in range(first, i):
                        u = view.x + k + 0.5
                        out[j, k] = quantised((a * u + b) / (c * u + d))
                    continue
                elif name >= 0:  # an image, or cells on something round
                    v = view.y + j + 0.5
                    for k in range(first, i):
                        u = view.x + k + 0.5
                        w = inverse_depth[f, 0] * u + (inverse_depth[f, 1] * v + inverse_depth[f, 2])
                        value = grey[f]
                        if kind[f] & SMOOTH:
                            value = (shade[f, 0] * u + (shade[f, 1] * v + shade[f, 2])) / w
                        if kind[f] & CELLS:
                            value *= texels[cell_index(uv, cells, f, u, v, w)]
                        else:
                            value *= filtered_reflectance(
                                inverse_depth, uv, texture, level_start, levels, texels, f, u, v
                            )
                        out[j, k] = quantised(value)
                    continue
                for k in range(first, i):
                    out[j, k] = quantised(value)
            while i < view.width and flags[i] != 0:
                mean, f = -1.0, identity[j, i] >> REGION_BITS
                if flags[i] == 1 and f >= 0:
                    if kind[f] == SMOOTH:
                        mean = mean_surface_grey(
                            view, inverse_depth, shade, surface, kind, depth, identity, j, i
                        )
                    elif kind[f] == TEXTURED | CELLS and (
                        f
                        == identity[j, i + 1] >> REGION_BITS
                        == identity[j + 1, i] >> REGION_BITS
                        == identity[j + 1, i + 1] >> REGION_BITS
                    ):
                        x, y = view.x + i, view.y + j
                        mean = grey[f] * mean_cell_reflectance(
                            uv, cells, inverse_depth, texels, f, x, y, cell_positions, texel
                        )
                if mean >= 0.0:
                    out[j, i] = quantised(mean)
                else:
                    column[count] = i
                    count += 1
                i += 1
    start[view.height] = count


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


@inlined
def mean_surface_grey(
    view: View,
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
    total = 0.0
    for k in range(4):
        row, column = j + k // 2, i + k % 2
        g = identity[row, column] >> REGION_BITS
        u, v, w = float(view.x + column), float(view.y + row), np.float64(depth[row, column])
        # One part of the surface may hide another: then there is a step, more than the slopes explain.
        step = abs(w - (a * u + (b * v + c)))
        slopes = abs(a) + abs(b) + abs(inverse_depth[g, 0]) + abs(inverse_depth[g, 1])
        if g < 0 or kind[g] != SMOOTH or surface[g] != surface[f] or step > 0.5 * slopes + 1e-4 * w:
            total = -np.inf
        else:
            total += (shade[g, 0] * u + (shade[g, 1] * v + shade[g, 2])) / w
    return max(0.25 * total, -1.0)
