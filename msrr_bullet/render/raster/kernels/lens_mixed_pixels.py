"""Mixed pixels behind a lens that distorts: as in :mod:`.mixed_pixels`, with samples placed by their maps."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.lens_floor import floor_grey_at
from msrr_bullet.render.raster.kernels.lens_simple_pixels import mean_cells_of_pixel, pulled_back
from msrr_bullet.render.raster.kernels.mixed_pixels import (
    GREATEST_KEY,
    IDENTITY_BITS,
    LEAST_IDENTITY,
    first_pixel,
    sample_key,
)
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
    LensView,
    ProjectedFaces,
    Samples,
    Textures,
)
from msrr_bullet.render.raster.kernels.sample_positions import CELL_SAMPLES, SAMPLES
from msrr_bullet.render.raster.kernels.simple_pixels import quantised
from msrr_bullet.render.raster.kernels.textures import cell_index, filtered_reflectance
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels


@subroutine
def cover_lens_samples(
    height: int,
    faces: ProjectedFaces,
    count: int,
    floor: Array,
    positions: Floats,
    samples: Samples,
    maps: Array,
) -> None:
    """Draw wall, floor and all faces on the samples of the mixed pixels of a band of rows."""
    start, column, key, farthest = samples.start, samples.column, samples.key, samples.farthest
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    nearest, spans = faces.nearest, faces.spans
    # How far inside the edges that cross the pixel, but for the last of them, each sample is.
    reach = np.full(SAMPLES, np.inf, np.float32)
    for p in range(start[height]):
        a, b, c = pulled_back(floor[0], floor[1], floor[2], maps, p)
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
            begin = first_pixel(column, start[j], start[j + 1], spans[f, 2])
            for p in range(begin, start[j + 1]):
                if column[p] >= spans[f, 3]:
                    break
                if greatest <= farthest[p]:  # behind every sample
                    continue
                if maps[p, 0] + maps[p, 2] + max(maps[p, 4], 0.0) < left:
                    continue
                if maps[p, 0] + min(maps[p, 4], 0.0) > right:
                    continue
                a, b, c = pulled_back(fa, fb, fc, maps, p)
                bound = np.float32(max((c + max(a, 0.0) + max(b, 0.0)) * 1.000001, 0.0))
                if sample_key(bound, name) <= farthest[p]:
                    continue
                crossed, outside = 0, False
                ea32, eb32, ec32 = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                for e in range(first, end):
                    ea, eb, ec = pulled_back(edges[e, 0], edges[e, 1], edges[e, 2], maps, p)
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


@inlined
def sample_place(maps: Array, p: int, positions: Floats, s: int) -> tuple[float, float]:
    """Return where sample s of mixed pixel p lies in the image of the ideal lens."""
    x, y = positions[0, s], positions[1, s]
    return maps[p, 0] + (maps[p, 2] * x + maps[p, 4] * y), maps[p, 1] + (maps[p, 3] * x + maps[p, 5] * y)


@subroutine
def shade_lens_mixed_pixels(
    view: LensView,
    top: int,
    height: int,
    faces: ProjectedFaces,
    textures: Textures,
    floor_texture: FloorTexture,
    floor_view: FloorView,
    positions: Floats,
    cell_positions: Floats,
    samples: Samples,
    maps: Array,
    out: Pixels,
) -> None:
    """Write the mean of the samples of every mixed pixel of a band of rows."""
    start, column, key = samples.start, samples.column, samples.key
    kind, grey, shade, inverse_depth = faces.kind, faces.grey, faces.shade, faces.inverse_depth
    cells, uv, texture = faces.cells, faces.uv, faces.texture
    level_start, levels, texels = textures.level_start, textures.levels, textures.texels
    texel, identity = np.empty(CELL_SAMPLES, np.uint32), np.empty(SAMPLES, np.int32)
    for j in range(height):
        for p in range(start[j], start[j + 1]):
            differs = np.int32(0)
            for s in range(SAMPLES):
                identity[s] = np.int32((key[p, s] & IDENTITY_BITS) + LEAST_IDENTITY)
                differs |= identity[s] ^ identity[0]
            f = identity[0] >> REGION_BITS
            total = 0.0
            if differs == 0 and f >= 0 and kind[f] == TEXTURED | CELLS:
                total = grey[f] * mean_cells_of_pixel(
                    uv, cells, inverse_depth, texels, f, maps, p, cell_positions, texel
                )
            else:
                middle_u = maps[p, 0] + 0.5 * (maps[p, 2] + maps[p, 4])
                middle_v = maps[p, 1] + 0.5 * (maps[p, 3] + maps[p, 5])
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
                            value = floor_grey_at(view, floor_texture, floor_view, top + j, column[p])
                        elif name == WALL:
                            value = floor_texture.wall
                        elif steady:
                            value = grey[f]
                        elif kind[f] & CELLS:
                            if f != bitmap:  # for all samples at once, which becomes vector code
                                bitmap = f
                                a, b, c = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
                                for n in range(SAMPLES):
                                    u, v = sample_place(maps, p, positions, n)
                                    w = a * u + (b * v + c)
                                    texel[n] = cell_index(uv, cells, f, u, v, w)
                        elif kind[f] & TEXTURED:
                            # The filter is as wide as a pixel: one lookup serves all samples of a face.
                            reflectance = filtered_reflectance(
                                inverse_depth, uv, texture, level_start, levels, texels, f, middle_u, middle_v
                            )
                    if not steady:
                        value = grey[f]
                        if kind[f] & SMOOTH:
                            u, v = sample_place(maps, p, positions, s)
                            w = inverse_depth[f, 0] * u + (inverse_depth[f, 1] * v + inverse_depth[f, 2])
                            value = (shade[f, 0] * u + (shade[f, 1] * v + shade[f, 2])) / w
                        if kind[f] & CELLS:
                            value *= texels[texel[s]]
                        elif kind[f] & TEXTURED:
                            value *= reflectance
                    total += value
                total /= SAMPLES
            out[j, column[p]] = quantised(total)
