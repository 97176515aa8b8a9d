"""Resolve: open pixels, by sixteen samples with depth.

The samples are an N-rooks pattern: each lies in a row and a column of its own, so that the upright and level
edges of which docking scenes are made move through sixteen shades and not through four.

Loops over the samples have a fixed length and touch short arrays of single precision: they become a few
vector instructions. A form's value at a pixel is taken in double precision before it is rounded.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.compiled import inlined, kernel
from msrr_bullet.render.raster.ground import Ground, GroundView, Short
from msrr_bullet.render.raster.pattern import SAMPLES
from msrr_bullet.render.raster.picture import Textures, picture_at
from msrr_bullet.render.raster.projection import CELLS, SMOOTH, TEXTURED, Array, Faces, View
from msrr_bullet.render.raster.settle import (
    Pixels,
    Samples,
    floor_at,
    mean_of_cells,
    quantised,
)
from msrr_bullet.render.raster.visibility import FLOOR, REGION_BITS, WALL, Identities, cell_at


@inlined
def smallest(values: Short) -> np.float32:
    """Return the smallest of SAMPLES values; ``values`` is used up.

    A tree, which is vector code where a plain loop waits for itself.
    """
    for s in range(SAMPLES // 2):
        values[s] = min(values[s], values[s + SAMPLES // 2])
    for s in range(SAMPLES // 4):
        values[s] = min(values[s], values[s + SAMPLES // 4])
    least = values[0]
    for s in range(1, SAMPLES // 4):
        least = min(least, values[s])
    return least


@kernel
def clear_samples(view: View, floor: Array, pattern: Short, samples: Samples) -> None:
    """Fill the samples of all open pixels with floor and wall."""
    start, column = samples.start, samples.column
    depth, identity, farthest = samples.depth, samples.identity, samples.farthest
    rise, least = np.empty(SAMPLES, np.float32), np.empty(SAMPLES, np.float32)
    for s in range(SAMPLES):
        rise[s] = floor[0] * pattern[0, s] + floor[1] * pattern[1, s]
    for j in range(view.height):
        for p in range(start[j], start[j + 1]):
            corner = np.float32(floor[0] * (view.x + column[p]) + (floor[1] * (view.y + j) + floor[2]))
            for s in range(SAMPLES):
                w = max(corner + rise[s], np.float32(0.0))
                depth[p, s] = w
                identity[p, s] = FLOOR if w > np.float32(0.0) else WALL
                least[s] = w
            farthest[p] = smallest(least)


@kernel
def cover_samples(view: View, faces: Faces, count: int, pattern: Short, samples: Samples) -> None:
    """Draw all faces on the samples of the open pixels."""
    start, column = samples.start, samples.column
    depth, identity, farthest = samples.depth, samples.identity, samples.farthest
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    nearest = faces.nearest
    rise = np.empty(SAMPLES, np.float32)  # of 1 / z from a pixel's upper left corner to each sample
    reach = np.empty(SAMPLES, np.float32)  # how far inside the edges that cross the pixel each sample is
    least = np.empty(SAMPLES, np.float32)
    for f in range(count):
        top = int(max(np.floor(box[f, 2]), float(view.y)))
        bottom = int(min(np.floor(box[f, 3]), view.y + view.height - 1.0))
        if top > bottom or start[top - view.y] == start[bottom - view.y + 1]:
            continue
        first, end = edge_start[f], edge_start[f + 1]
        a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        highest = max(a, 0.0) + max(b, 0.0)
        name = np.int32(f << REGION_BITS)
        for s in range(SAMPLES):
            rise[s] = a * pattern[0, s] + b * pattern[1, s]
        for y in range(top, bottom + 1):
            p, stop = start[y - view.y], start[y - view.y + 1]
            if p == stop or column[p] > box[f, 1] - view.x or column[stop - 1] < box[f, 0] - 1.0 - view.x:
                continue
            left, right = columns_touched(view, edges, first, end, box[f, 0], box[f, 1], y)
            p = first_from(column, p, stop, left)
            while p < stop and column[p] <= right:
                x = view.x + column[p]
                corner = a * x + (b * y + c)
                if np.float32(min(corner + highest, nearest[f])) >= farthest[p]:  # not behind every sample
                    for s in range(SAMPLES):
                        reach[s] = np.float32(0.0)
                    touched = True
                    for e in range(first, end):
                        ea, eb = edges[e, 0], edges[e, 1]
                        value = ea * x + (eb * y + edges[e, 2])
                        if value + max(ea, 0.0) + max(eb, 0.0) < 0.0:
                            touched = False
                            break
                        if value + min(ea, 0.0) + min(eb, 0.0) < 0.0:  # this edge crosses the pixel
                            ea32, eb32, value32 = np.float32(ea), np.float32(eb), np.float32(value)
                            for s in range(SAMPLES):
                                inside = value32 + (ea32 * pattern[0, s] + eb32 * pattern[1, s])
                                reach[s] = min(reach[s], inside)
                    if touched:
                        corner32 = np.float32(corner)
                        for s in range(SAMPLES):
                            w = corner32 + rise[s]
                            seen = (reach[s] >= np.float32(0.0)) & (w > depth[p, s])
                            least[s] = w if seen else depth[p, s]
                            depth[p, s] = least[s]
                            identity[p, s] = name if seen else identity[p, s]
                        farthest[p] = smallest(least)
                p += 1


@inlined
def columns_touched(
    view: View, edges: Array, first: int, end: int, u0: float, u1: float, y: int
) -> tuple[int, int]:
    """Return the first and the last column (from the window's left) in which a face may touch pixel row y."""
    low, high = max(u0, float(view.x)), min(u1, view.x + view.width - 1.0)
    for e in range(first, end):
        slope = edges[e, 3]
        if edges[e, 0] > 0.0:
            low = max(low, slope * y + edges[e, 4] + min(slope, 0.0))
        elif edges[e, 0] < 0.0:
            high = min(high, slope * y + edges[e, 4] + max(slope, 0.0))
        elif edges[e, 1] * y + edges[e, 2] + max(edges[e, 1], 0.0) < 0.0:
            high = -np.inf
    if not low <= high + 1.0:
        return 0, -1
    return int(np.floor(low)) - 1 - view.x, int(np.floor(high)) + 1 - view.x


@inlined
def first_from(columns: Identities, low: int, high: int, bound: int) -> int:
    """Return the first index in low .. high whose column is at least ``bound`` (high if there is none)."""
    while low < high:
        middle = (low + high) // 2
        if columns[middle] < bound:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def shade_open(
    view: View,
    faces: Faces,
    textures: Textures,
    ground: Ground,
    seen: GroundView,
    pattern: Short,
    samples: Samples,
    out: Pixels,
) -> None:
    """Write the mean of the samples of every open pixel."""
    start, column, identity = samples.start, samples.column, samples.identity
    kind, grey, cells, uv = faces.kind, faces.grey, faces.cells, faces.uv
    inverse_depth, shade, texels = faces.inverse_depth, faces.shade, textures.texels
    place = np.empty(SAMPLES, np.int32)
    texture, first_level, level_count = faces.texture, textures.first_level, textures.level_count
    level_start, level_rows = textures.level_start, textures.level_rows
    level_columns = textures.level_columns
    for j in range(view.height):
        y = view.y + j
        for p in range(start[j], start[j + 1]):
            x = view.x + column[p]
            differs = np.int32(0)
            for s in range(1, SAMPLES):
                differs |= identity[p, s] ^ identity[p, 0]
            f = identity[p, 0] >> REGION_BITS
            total = 0.0
            if differs == 0 and f >= 0 and kind[f] == TEXTURED | CELLS:
                total = grey[f] * mean_of_cells(uv, cells, inverse_depth, texels, f, x, y, pattern, place)
            else:
                floor, last, reflectance = -1.0, np.int32(WALL), 0.0
                for s in range(SAMPLES):
                    name = identity[p, s]
                    f = name >> REGION_BITS
                    if name == FLOOR:
                        if floor < 0.0:
                            floor = floor_at(ground, seen, x, y)
                        total += floor
                    elif name == WALL:
                        total += ground.wall
                    elif kind[f] == 0:
                        total += grey[f]
                    else:
                        u, v = x + pattern[0, s], y + pattern[1, s]
                        w = inverse_depth[f, 0] * u + (inverse_depth[f, 1] * v + inverse_depth[f, 2])
                        if kind[f] == TEXTURED | CELLS:
                            total += grey[f] * texels[cell_at(uv, cells, f, u, v, w)]
                        else:
                            value = grey[f]
                            if kind[f] & SMOOTH:
                                value = (shade[f, 0] * u + (shade[f, 1] * v + shade[f, 2])) / w
                            if kind[f] & CELLS:
                                value *= texels[cell_at(uv, cells, f, u, v, w)]
                            elif kind[f] & TEXTURED:
                                # The filter is as wide as a pixel: one lookup serves all samples of a face.
                                if name != last:
                                    last = name
                                    reflectance = picture_at(
                                        inverse_depth,
                                        uv,
                                        texture,
                                        first_level,
                                        level_count,
                                        level_start,
                                        level_rows,
                                        level_columns,
                                        texels,
                                        f,
                                        x + 0.5,
                                        y + 0.5,
                                    )
                                value *= reflectance
                            total += value
                total /= SAMPLES
            out[j, column[p]] = quantised(total)
