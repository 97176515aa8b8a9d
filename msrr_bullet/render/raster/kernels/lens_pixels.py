"""Pixels seen through a lens that distorts: simple ones at their middle, mixed ones by samples with depth.

The samples of a pixel are placed by the affine map that fits its four corners best: a form over the image of
the ideal lens becomes a form over the unit square of the pixel.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, kernel
from msrr_bullet.render.raster.kernels.floor import STEPS, bilinear_grey, floor_texel
from msrr_bullet.render.raster.kernels.mixed_pixels import GREATEST_KEY, LEAST_IDENTITY, sample_key
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    SMOOTH,
    TEXTURED,
    WALL,
    Corners,
    Floats,
    FloorTexture,
    FloorView,
    Indices,
    LensView,
    ProjectedFaces,
    Samples,
    Textures,
)
from msrr_bullet.render.raster.kernels.sample_positions import SAMPLES
from msrr_bullet.render.raster.kernels.simple_pixels import REGION_MASK, flag_row, quantised
from msrr_bullet.render.raster.kernels.textures import cell_index, filtered_reflectance
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Bits of a key that hold the identity.
_LOW = (1 << 32) - 1


@inlined
def floor_grey_at(texture: FloorTexture, seen: FloorView, u: float, v: float) -> float:
    """Return the floor's grey level at a point of the image of the ideal lens."""
    forms, last = seen.forms, len(texture.start) - 1
    t = max(forms[2, 0] * u + (forms[2, 1] * v + forms[2, 2]), 1e-4)
    level = STEPS * np.log2(seen.scale * (t + seen.lean) / (t * t)) + 0.5
    blend = int(min(max(level, 0.0), float(last)))
    bits = texture.bits[blend]
    index, ax, ay = floor_texel(
        np.float32(forms[0, 0] * u + (forms[0, 1] * v + forms[0, 2])),
        np.float32(forms[1, 0] * u + (forms[1, 1] * v + forms[1, 2])),
        np.float32(t),
        np.int32(texture.start[blend]),
        np.int32(bits),
        np.float32((1 << bits) / (1 << texture.bits[0])),
    )
    return float(bilinear_grey(texture.texels[index], ax, ay))


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


@kernel
def shade_lens_simple_pixels(
    view: LensView,
    top: int,
    height: int,
    faces: ProjectedFaces,
    textures: Textures,
    floor_texture: FloorTexture,
    floor_view: FloorView,
    corners: Corners,
    flags: Pixels,
    samples: Samples,
    maps: Array,
    out: Pixels,
) -> None:
    """Write the pixels of a band of rows that show one thing only, and list the others with their maps.

    ``maps``, shape (P, 6), gets the place (u, v) of each listed pixel's upper left corner, and how u and v
    change along its columns and along its rows.
    """
    u, v, identity = view.u, view.v, corners.identity
    start, column = samples.start, samples.column
    kind, grey, shade, inverse_depth = faces.kind, faces.grey, faces.shade, faces.inverse_depth
    cells, uv, texture = faces.cells, faces.uv, faces.texture
    level_start, levels, texels = textures.level_start, textures.levels, textures.texels
    region_grey = textures.region_grey
    width = u.shape[1] - 1
    count = 0
    for j in range(height):
        start[j] = count
        flag_row(corners.depth, identity, corners.edge_depth, j, width, flags)
        k = top + j
        for i in range(width):
            middle_u = 0.25 * ((u[k, i] + u[k, i + 1]) + (u[k + 1, i] + u[k + 1, i + 1]))
            middle_v = 0.25 * ((v[k, i] + v[k, i + 1]) + (v[k + 1, i] + v[k + 1, i + 1]))
            name = identity[j, i]
            if flags[i] == 0:
                value = floor_texture.wall
                f = name >> REGION_BITS
                if name >= 0 and kind[f] == 0:
                    value = grey[f]
                elif name >= 0 and kind[f] == TEXTURED | CELLS:
                    value = grey[f] * region_grey[cells[f, 3] + (name & REGION_MASK)]
                elif name >= 0:
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
                        middle_u,
                        middle_v,
                    )
                elif name == FLOOR:
                    value = floor_grey_at(floor_texture, floor_view, middle_u, middle_v)
                out[j, i] = quantised(value)
            else:
                ux = 0.5 * ((u[k, i + 1] - u[k, i]) + (u[k + 1, i + 1] - u[k + 1, i]))
                vx = 0.5 * ((v[k, i + 1] - v[k, i]) + (v[k + 1, i + 1] - v[k + 1, i]))
                uy = 0.5 * ((u[k + 1, i] - u[k, i]) + (u[k + 1, i + 1] - u[k, i + 1]))
                vy = 0.5 * ((v[k + 1, i] - v[k, i]) + (v[k + 1, i + 1] - v[k, i + 1]))
                maps[count, 0] = middle_u - 0.5 * (ux + uy)
                maps[count, 1] = middle_v - 0.5 * (vx + vy)
                maps[count, 2], maps[count, 3], maps[count, 4], maps[count, 5] = ux, vx, uy, vy
                column[count] = i
                count += 1
    start[height] = count


@inlined
def pulled_back(a: float, b: float, c: float, maps: Array, p: int) -> tuple[float, float, float]:
    """Return a form over the image as a form over the unit square of mixed pixel p."""
    x = a * maps[p, 2] + b * maps[p, 3]
    y = a * maps[p, 4] + b * maps[p, 5]
    return x, y, a * maps[p, 0] + (b * maps[p, 1] + c)


@kernel
def cover_lens_samples(
    view: LensView,
    top: int,
    height: int,
    faces: ProjectedFaces,
    count: int,
    floor: Array,
    positions: Floats,
    samples: Samples,
    maps: Array,
) -> None:
    """Draw wall, floor and all faces on the samples of the mixed pixels of a band of rows."""
    start, key, farthest = samples.start, samples.key, samples.farthest
    inverse_depth, edge_start, edges, box = faces.inverse_depth, faces.edge_start, faces.edges, faces.box
    reach = np.empty(SAMPLES, np.float32)  # how far inside all edges each sample is
    for p in range(start[height]):
        a, b, c = pulled_back(floor[0], floor[1], floor[2], maps, p)
        farthest[p] = GREATEST_KEY
        for s in range(SAMPLES):
            w = max(np.float32(a * positions[0, s] + (b * positions[1, s] + c)), np.float32(0.0))
            key[p, s] = sample_key(w, FLOOR if w > np.float32(0.0) else WALL)
            farthest[p] = min(farthest[p], key[p, s])
    for f in range(count):
        first, end = edge_start[f], edge_start[f + 1]
        name = np.int32(f << REGION_BITS)
        left, right, upper, lower = box[f, 0], box[f, 1], box[f, 2], box[f, 3]
        fa, fb, fc = inverse_depth[f, 0], inverse_depth[f, 1], inverse_depth[f, 2]
        for j in range(height):
            if start[j] == start[j + 1] or max(view.v_high[top + j], view.v_high[top + j + 1]) < upper:
                continue
            if min(view.v_low[top + j], view.v_low[top + j + 1]) > lower:
                break
            for p in range(start[j], start[j + 1]):
                if maps[p, 0] + maps[p, 2] + max(maps[p, 4], 0.0) < left:
                    continue
                if maps[p, 0] + min(maps[p, 4], 0.0) > right:
                    break
                a, b, c = pulled_back(fa, fb, fc, maps, p)
                bound = np.float32(max((c + max(a, 0.0) + max(b, 0.0)) * 1.000001, 0.0))
                if sample_key(bound, name) <= farthest[p]:  # behind every sample
                    continue
                crossed, outside = False, False
                for e in range(first, end):
                    ea, eb, ec = pulled_back(edges[e, 0], edges[e, 1], edges[e, 2], maps, p)
                    if ec + max(ea, 0.0) + max(eb, 0.0) < 0.0:
                        outside = True
                        break
                    if ec + min(ea, 0.0) + min(eb, 0.0) < 0.0:  # this edge crosses the pixel
                        ea32, eb32, ec32 = np.float32(ea), np.float32(eb), np.float32(ec)
                        for s in range(SAMPLES):
                            inside = ec32 + (ea32 * positions[0, s] + eb32 * positions[1, s])
                            reach[s] = min(reach[s], inside) if crossed else inside
                        crossed = True
                if outside:
                    continue
                a32, b32, c32, least = np.float32(a), np.float32(b), np.float32(c), GREATEST_KEY
                for s in range(SAMPLES):
                    w = max(c32 + (a32 * positions[0, s] + b32 * positions[1, s]), np.float32(0.0))
                    if crossed and reach[s] < np.float32(0.0):
                        w = np.float32(0.0)
                    key[p, s] = max(key[p, s], sample_key(w, name if w > np.float32(0.0) else WALL))
                    least = min(least, key[p, s])
                farthest[p] = least


@kernel
def shade_lens_mixed_pixels(
    height: int,
    faces: ProjectedFaces,
    textures: Textures,
    floor_texture: FloorTexture,
    floor_view: FloorView,
    positions: Floats,
    samples: Samples,
    maps: Array,
    out: Pixels,
) -> None:
    """Write the mean of the samples of every mixed pixel of a band of rows."""
    start, column, key = samples.start, samples.column, samples.key
    kind, grey, shade, inverse_depth = faces.kind, faces.grey, faces.shade, faces.inverse_depth
    cells, uv, texture = faces.cells, faces.uv, faces.texture
    level_start, levels, texels = textures.level_start, textures.levels, textures.texels
    for j in range(height):
        for p in range(start[j], start[j + 1]):
            last, steady, value, total = WALL, True, floor_texture.wall, 0.0
            for s in range(SAMPLES):
                name = int((key[p, s] & _LOW) + LEAST_IDENTITY)
                u = maps[p, 0] + (maps[p, 2] * positions[0, s] + maps[p, 4] * positions[1, s])
                v = maps[p, 1] + (maps[p, 3] * positions[0, s] + maps[p, 5] * positions[1, s])
                if name != last or not steady:
                    last = name
                    f = name >> REGION_BITS
                    steady = name < 0 or bool(kind[f] == 0)
                    if name == FLOOR:
                        value = floor_grey_at(floor_texture, floor_view, u, v)
                    elif name == WALL:
                        value = floor_texture.wall
                    else:
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
                            u,
                            v,
                        )
                total += value
            out[j, column[p]] = quantised(total / SAMPLES)
