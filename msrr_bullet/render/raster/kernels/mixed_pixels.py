"""Mixed pixels, in which faces meet, get the mean of sixteen samples with depth.

The samples form an N-rooks pattern: each lies in a row and a column of its own, so that the upright and level
edges of which docking scenes are made move through sixteen shades and not through four.

Loops over the samples have a fixed length and touch short arrays of single precision: they become a few
vector instructions. A form's value at a pixel is taken in double precision before it is rounded.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.floor import floor_grey
from msrr_bullet.render.raster.kernels.grid import middle_column, middle_row
from msrr_bullet.render.raster.kernels.pixel_map import columns_of_pixel, over_pixel, place_in_pixel
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    SMOOTH,
    TEXTURED,
    WALL,
    Floats,
    FloorTexture,
    FloorView,
    Identities,
    PixelGrid,
    ProjectedFaces,
    Samples,
    Textures,
)
from msrr_bullet.render.raster.kernels.sample_positions import CELL_SAMPLES, SAMPLES
from msrr_bullet.render.raster.kernels.simple_pixels import mean_cells_of_pixel, quantised
from msrr_bullet.render.raster.kernels.textures import cell_index, filtered_reflectance
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Identities count up from here, so that in a key they are not negative.
LEAST_IDENTITY = WALL

#: Bits of a key that hold the identity.
IDENTITY_BITS = (1 << 32) - 1

#: Greater than any key.
GREATEST_KEY = (1 << 63) - 1


@inlined
def sample_key(w: np.float32, identity: np.int32 | int) -> np.int64:
    """Return depth and identity as one number, greater for what is nearer.

    Read as whole numbers, the bits of floats >= 0 are in the order of the floats. At equal depth the greater
    identity is the greater number, so that no order of drawing can matter.
    """
    return (np.int64(np.float32(w).view(np.int32)) << 32) | (np.int64(identity) - LEAST_IDENTITY)


@inlined
def first_pixel(column: Identities, start: int, end: int, left: int) -> int:
    """Return the first of a row's mixed pixels, ``start`` to ``end``, that is not left of column ``left``."""
    while start < end:
        middle = (start + end) >> 1
        if column[middle] < left:
            start = middle + 1
        else:
            end = middle
    return start


@subroutine
def cover_samples(
    grid: PixelGrid,
    top: int,
    height: int,
    faces: ProjectedFaces,
    count: int,
    floor: Array,
    positions: Floats,
    samples: Samples,
) -> None:
    """Draw wall, floor and all faces on the samples of the mixed pixels of a band of rows."""
    start, column, key, farthest = samples.start, samples.column, samples.key, samples.farthest
    u, v, maps = grid.u, grid.v, samples.maps
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    nearest, spans = faces.nearest, faces.spans
    # How far inside the edges that cross the pixel, but for the last of them, each sample is.
    reach = np.full(SAMPLES, np.inf, np.float32)
    for j in range(height):
        for p in range(start[j], start[j + 1]):
            a, b, c = over_pixel(u, v, maps, p, top + j, column[p], floor[0], floor[1], floor[2])
            least = GREATEST_KEY
            for s in range(SAMPLES):
                w = max(np.float32(a * positions[0, s] + (b * positions[1, s] + c)), np.float32(0.0))
                key[p, s] = sample_key(w, FLOOR if w > np.float32(0.0) else WALL)
                least = min(least, key[p, s])
            farthest[p] = least
    for f in range(count):
        first, end = edge_start[f], edge_start[f + 1]
        name = np.int32(f << REGION_BITS)
        left, right, greatest = box[f, 0], box[f, 1], sample_key(np.float32(nearest[f] * 1.000001), name)
        fa, fb, fc = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        for j in range(spans[f, 0], spans[f, 1]):
            k = top + j
            begin = first_pixel(column, start[j], start[j + 1], spans[f, 2])
            for p in range(begin, start[j + 1]):
                i = column[p]
                if i >= spans[f, 3]:
                    break
                if greatest <= farthest[p]:  # behind every sample
                    continue
                u0, u1 = columns_of_pixel(u, maps, p, k, i)
                if u1 < left or u0 > right:
                    continue
                a, b, c = over_pixel(u, v, maps, p, k, i, fa, fb, fc)
                bound = np.float32(max((c + max(a, 0.0) + max(b, 0.0)) * 1.000001, 0.0))
                if sample_key(bound, name) <= farthest[p]:
                    continue
                crossed, outside = 0, False
                ea32, eb32, ec32 = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                for e in range(first, end):
                    ea, eb, ec = over_pixel(u, v, maps, p, k, i, edges[e, 0], edges[e, 1], edges[e, 2])
                    if ec + max(ea, 0.0) + max(eb, 0.0) < 0.0:
                        outside = True
                        break
                    if ec + min(ea, 0.0) + min(eb, 0.0) < 0.0:  # this edge crosses the pixel
                        if crossed > 0:
                            for s in range(SAMPLES):
                                inside = ec32 + (ea32 * positions[0, s] + eb32 * positions[1, s])
                                reach[s] = min(reach[s], inside)
                        ea32, eb32, ec32 = np.float32(ea), np.float32(eb), np.float32(ec)
                        crossed += 1
                if not outside:
                    a32, b32, c32, least = np.float32(a), np.float32(b), np.float32(c), GREATEST_KEY
                    for s in range(SAMPLES):
                        w = max(c32 + (a32 * positions[0, s] + b32 * positions[1, s]), np.float32(0.0))
                        inside = ec32 + (ea32 * positions[0, s] + eb32 * positions[1, s])
                        w = w if min(inside, reach[s]) >= np.float32(0.0) else np.float32(0.0)
                        key[p, s] = max(key[p, s], sample_key(w, name if w > np.float32(0.0) else WALL))
                        least = min(least, key[p, s])
                    farthest[p] = least
                if crossed > 1:
                    reach[:] = np.float32(np.inf)


@subroutine
def shade_mixed_pixels(
    grid: PixelGrid,
    top: int,
    height: int,
    faces: ProjectedFaces,
    textures: Textures,
    floor_texture: FloorTexture,
    floor_view: FloorView,
    positions: Floats,
    cell_positions: Floats,
    samples: Samples,
    out: Pixels,
) -> None:
    """Write the mean of the samples of every mixed pixel of a band of rows."""
    start, column, key = samples.start, samples.column, samples.key
    maps, u, v = samples.maps, grid.u, grid.v
    kind, grey, shade, inverse_depth = faces.kind, faces.grey, faces.shade, faces.inverse_depth
    cells, uv, texture = faces.cells, faces.uv, faces.texture
    level_start, levels, texels = textures.level_start, textures.levels, textures.texels
    texel, identity = np.empty(CELL_SAMPLES, np.uint32), np.empty(SAMPLES, np.int32)
    for j in range(height):
        k = top + j
        for p in range(start[j], start[j + 1]):
            i = column[p]
            differs = np.int32(0)
            for s in range(SAMPLES):
                identity[s] = np.int32((key[p, s] & IDENTITY_BITS) + LEAST_IDENTITY)
                differs |= identity[s] ^ identity[0]
            f = identity[0] >> REGION_BITS
            total = 0.0
            if differs == 0 and f >= 0 and kind[f] == TEXTURED | CELLS:
                total = grey[f] * mean_cells_of_pixel(
                    u, v, maps, p, k, i, uv, cells, inverse_depth, texels, f, cell_positions, texel
                )
            else:
                # Most samples show what the one before showed; ``steady``: its grey level is constant.
                last, steady, value, reflectance = np.int32(WALL), True, floor_texture.wall, 0.0
                bitmap = -1  # the face with cells that ``texel`` is filled for
                for s in range(SAMPLES):
                    name = identity[s]
                    f = name >> REGION_BITS
                    if name != last:
                        last = name
                        steady = name < 0 or kind[f] == 0
                        if name == FLOOR:
                            value = floor_grey(grid, floor_texture, floor_view, k, i)
                        elif name == WALL:
                            value = floor_texture.wall
                        elif steady:
                            value = grey[f]
                        elif kind[f] & CELLS:
                            if f != bitmap:  # for all samples at once, which becomes vector code
                                bitmap = f
                                a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
                                for n in range(SAMPLES):
                                    x, y = place_in_pixel(
                                        u, v, maps, p, k, i, positions[0, n], positions[1, n]
                                    )
                                    w = a * x + (b * y + c)
                                    texel[n] = cell_index(uv, cells, f, x, y, w)
                        elif kind[f] & TEXTURED:
                            # The filter is as wide as a pixel: one lookup serves all samples of a face.
                            reflectance = filtered_reflectance(
                                inverse_depth,
                                uv,
                                texture,
                                level_start,
                                levels,
                                texels,
                                f,
                                middle_column(u, k, i),
                                middle_row(v, k, i),
                            )
                    if not steady:
                        value = grey[f]
                        if kind[f] & SMOOTH:
                            x, y = place_in_pixel(u, v, maps, p, k, i, positions[0, s], positions[1, s])
                            w = inverse_depth[f, 0] * x + (inverse_depth[f, 1] * y + inverse_depth[f, 2])
                            value = (shade[f, 0] * x + (shade[f, 1] * y + shade[f, 2])) / w
                        if kind[f] & CELLS:
                            value *= texels[texel[s]]
                        elif kind[f] & TEXTURED:
                            value *= reflectance
                    total += value
                total /= SAMPLES
            out[j, i] = quantised(total)
