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
    ProjectedFaces,
    Samples,
    Textures,
    View,
)
from msrr_bullet.render.raster.kernels.sample_positions import CELL_SAMPLES, SAMPLES
from msrr_bullet.render.raster.kernels.simple_pixels import quantised
from msrr_bullet.render.raster.kernels.textures import cell_index, filtered_reflectance, mean_cell_reflectance
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


@subroutine
def clear_samples(view: View, floor: Array, positions: Floats, samples: Samples) -> None:
    """Fill the samples of all mixed pixels with wall and floor, whose 1 / z has the form ``floor``."""
    start, column, key, farthest = samples.start, samples.column, samples.key, samples.farthest
    rise = np.empty(SAMPLES, np.float32)
    for s in range(SAMPLES):
        rise[s] = floor[0] * positions[0, s] + floor[1] * positions[1, s]
    for j in range(view.height):
        for p in range(start[j], start[j + 1]):
            corner = np.float32(floor[0] * (view.x + column[p]) + (floor[1] * (view.y + j) + floor[2]))
            least = GREATEST_KEY
            for s in range(SAMPLES):
                w = max(corner + rise[s], np.float32(0.0))
                key[p, s] = sample_key(w, FLOOR if w > np.float32(0.0) else WALL)
                least = min(least, key[p, s])
            farthest[p] = least


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
def cover_samples(view: View, faces: ProjectedFaces, count: int, positions: Floats, samples: Samples) -> None:
    """Draw all faces on the samples of the mixed pixels."""
    start, column, key, farthest = samples.start, samples.column, samples.key, samples.farthest
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    nearest = faces.nearest
    rise = np.empty(SAMPLES, np.float32)  # of 1 / z from a pixel's upper left corner to each sample
    # How far inside the edges that cross the pixel, but for the last of them, each sample is.
    reach = np.full(SAMPLES, np.inf, np.float32)
    for f in range(count):
        top = int(max(np.floor(box[f, 2]), float(view.y)))
        bottom = int(min(np.floor(box[f, 3]), view.y + view.height - 1.0))
        if top > bottom or start[top - view.y] == start[bottom - view.y + 1]:
            continue
        first, end = edge_start[f], edge_start[f + 1]
        a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        highest = max(a, 0.0) + max(b, 0.0)
        name = np.int32(f << REGION_BITS)
        left, right = int(np.floor(box[f, 0])) - view.x, int(np.floor(box[f, 1])) - view.x
        for s in range(SAMPLES):
            rise[s] = a * positions[0, s] + b * positions[1, s]
        for y in range(top, bottom + 1):
            p, stop = start[y - view.y], start[y - view.y + 1]
            if p == stop or column[p] > right or column[stop - 1] < left:
                continue
            p = first_pixel(column, p, stop, left)
            while p < stop and column[p] <= right:
                x = view.x + column[p]
                corner = a * x + (b * y + c)
                bound = np.float32(max(min(corner + highest, nearest[f]), 0.0))
                if sample_key(bound, name) > farthest[p]:  # not behind every sample
                    crossed, outside = 0, False
                    ea32, eb32, value32 = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                    for e in range(first, end):
                        ea, eb = edges[e, 0], edges[e, 1]
                        value = ea * x + (eb * y + edges[e, 2])
                        if value + max(ea, 0.0) + max(eb, 0.0) < 0.0:
                            outside = True
                            break
                        if value + min(ea, 0.0) + min(eb, 0.0) < 0.0:  # this edge crosses the pixel
                            if crossed > 0:
                                for s in range(SAMPLES):
                                    inside = value32 + (ea32 * positions[0, s] + eb32 * positions[1, s])
                                    reach[s] = min(reach[s], inside)
                            ea32, eb32, value32 = np.float32(ea), np.float32(eb), np.float32(value)
                            crossed += 1
                    if not outside:
                        corner32, least = np.float32(corner), GREATEST_KEY
                        for s in range(SAMPLES):
                            w = max(corner32 + rise[s], np.float32(0.0))
                            inside = value32 + (ea32 * positions[0, s] + eb32 * positions[1, s])
                            w = w if min(inside, reach[s]) >= np.float32(0.0) else np.float32(0.0)
                            key[p, s] = max(key[p, s], sample_key(w, name if w > np.float32(0.0) else WALL))
                            least = min(least, key[p, s])
                        farthest[p] = least
                    if crossed > 1:
                        reach[:] = np.float32(np.inf)
                p += 1


@subroutine
def shade_mixed_pixels(
    view: View,
    faces: ProjectedFaces,
    textures: Textures,
    floor_texture: FloorTexture,
    floor_view: FloorView,
    positions: Floats,
    cell_positions: Floats,
    samples: Samples,
    out: Pixels,
) -> None:
    """Write the mean of the samples of every mixed pixel."""
    start, column, key = samples.start, samples.column, samples.key
    kind, grey, cells, uv = faces.kind, faces.grey, faces.cells, faces.uv
    inverse_depth, shade, texels = faces.inverse_depth, faces.shade, textures.texels
    texel, identity = np.empty(CELL_SAMPLES, np.uint32), np.empty(SAMPLES, np.int32)
    texture, level_start, levels = faces.texture, textures.level_start, textures.levels
    for j in range(view.height):
        y = view.y + j
        for p in range(start[j], start[j + 1]):
            x = view.x + column[p]
            differs = np.int32(0)
            for s in range(SAMPLES):
                identity[s] = np.int32((key[p, s] & IDENTITY_BITS) + LEAST_IDENTITY)
                differs |= identity[s] ^ identity[0]
            f = identity[0] >> REGION_BITS
            total = 0.0
            if differs == 0 and f >= 0 and kind[f] == TEXTURED | CELLS:
                total = grey[f] * mean_cell_reflectance(
                    uv, cells, inverse_depth, texels, f, x, y, cell_positions, texel
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
                            value = floor_grey(floor_texture, floor_view, x, y)
                        elif name == WALL:
                            value = floor_texture.wall
                        elif steady:
                            value = grey[f]
                        elif kind[f] & CELLS:
                            if f != bitmap:  # for all samples at once, which becomes vector code
                                bitmap = f
                                a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
                                for n in range(SAMPLES):
                                    u, v = x + positions[0, n], y + positions[1, n]
                                    w = a * u + (b * v + c)
                                    texel[n] = cell_index(uv, cells, f, u, v, w)
                        elif kind[f] & TEXTURED:
                            # The filter is as wide as a pixel: one lookup serves all samples of a face.
                            reflectance = filtered_reflectance(
                                inverse_depth, uv, texture, level_start, levels, texels, f, x + 0.5, y + 0.5
                            )
                    if not steady:
                        value = grey[f]
                        if kind[f] & SMOOTH:
                            u, v = x + positions[0, s], y + positions[1, s]
                            w = inverse_depth[f, 0] * u + (inverse_depth[f, 1] * v + inverse_depth[f, 2])
                            value = (shade[f, 0] * u + (shade[f, 1] * v + shade[f, 2])) / w
                        if kind[f] & CELLS:
                            value *= texels[texel[s]]
                        elif kind[f] & TEXTURED:
                            value *= reflectance
                    total += value
                total /= SAMPLES
            out[j, column[p]] = quantised(total)
