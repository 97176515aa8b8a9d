"""Settled pixels: those whose corners agree get the grey level of what they show, the others are listed."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiled import inlined, kernel
from msrr_bullet.render.raster.kernels.ground import shade_floor
from msrr_bullet.render.raster.kernels.pattern import CELL_SAMPLES
from msrr_bullet.render.raster.kernels.picture import picture_at
from msrr_bullet.render.raster.kernels.records import (
    CELLS,
    FLOOR,
    REGION_BITS,
    SMOOTH,
    TEXTURED,
    Corners,
    Faces,
    Ground,
    GroundView,
    Identities,
    Indices,
    Pixels,
    Samples,
    Scratch,
    Short,
    Textures,
    View,
)
from msrr_bullet.render.raster.kernels.visibility import cell_at
from msrr_scenes.arrays import Array

_REGION_MASK = (1 << REGION_BITS) - 1


@inlined
def quantised(grey: float) -> np.uint8:
    """Return the nearest of the 256 grey levels."""
    return np.uint8(min(max(grey, 0.0), 255.0) + 0.5)


@inlined
def mean_of_cells(
    uv: Array,
    cells: Indices,
    inverse_depth: Array,
    texels: Short,
    f: int,
    x: int,
    y: int,
    pattern: Short,
    place: Identities,
) -> float:
    """Return the mean reflectance of face f's bitmap over a pixel that shows nothing else."""
    sa, sb = np.float32(uv[f, 0, 0]), np.float32(uv[f, 0, 1])
    ta, tb = np.float32(uv[f, 1, 0]), np.float32(uv[f, 1, 1])
    wa, wb = np.float32(inverse_depth[f, 0]), np.float32(inverse_depth[f, 1])
    s0 = np.float32(uv[f, 0, 0] * x + (uv[f, 0, 1] * y + uv[f, 0, 2]))
    t0 = np.float32(uv[f, 1, 0] * x + (uv[f, 1, 1] * y + uv[f, 1, 2]))
    w0 = np.float32(inverse_depth[f, 0] * x + (inverse_depth[f, 1] * y + inverse_depth[f, 2]))
    start, rows, columns = np.int32(cells[f, 0]), np.int32(cells[f, 1]), np.int32(cells[f, 2])
    for s in range(CELL_SAMPLES):
        px, py = pattern[0, s], pattern[1, s]
        z = np.float32(1.0) / (w0 + (wa * px + wb * py))
        column = np.int32((s0 + (sa * px + sb * py)) * z * np.float32(columns))
        row = np.int32((np.float32(1.0) - (t0 + (ta * px + tb * py)) * z) * np.float32(rows))
        column = min(max(column, np.int32(0)), columns - np.int32(1))
        row = min(max(row, np.int32(0)), rows - np.int32(1))
        place[s] = start + row * columns + column
    total = np.float32(0.0)
    for s in range(CELL_SAMPLES):
        total += texels[place[s]]
    return float(total) / CELL_SAMPLES


@kernel
def settle(
    view: View,
    faces: Faces,
    textures: Textures,
    ground: Ground,
    seen: GroundView,
    corners: Corners,
    scratch: Scratch,
    cell_pattern: Short,
    samples: Samples,
    out: Pixels,
) -> None:
    """Write the settled pixels and list the open ones.

    A settled pixel shows at all four corners the same, so between two pixels that are not like that lies a
    run of one identity. Two more kinds of pixels are settled: where all corners show one bitmap, it fills the
    pixel, and is sampled without asking for depth; where they show one round surface, the pixel gets the mean
    of what its corners show.

    Args:
        view: Camera and band of the window.
        faces: In view.
        textures: What they wear.
        ground: The floor's texture.
        seen: The floor seen from the camera.
        corners: Of the band, all faces drawn.
        scratch: Memory for one row.
        cell_pattern: Places of the samples of cells in a pixel.
        samples: Its lists of open pixels are filled.
        out: The band's pixels.
    """
    depth, identity, sliver = corners.depth, corners.identity, corners.sliver
    kind, grey, cells, region_grey = faces.kind, faces.grey, faces.cells, textures.region_grey
    uv, inverse_depth, texels = faces.uv, faces.inverse_depth, textures.texels
    shade, surface = faces.shade, faces.surface
    texture, first_level, level_count = faces.texture, textures.first_level, textures.level_count
    level_start, level_rows = textures.level_start, textures.level_rows
    level_columns = textures.level_columns
    start, column = samples.start, samples.column
    flags, place = scratch.flags, scratch.place
    words = flags.view(np.uint64)
    count = 0
    for j in range(view.height):
        start[j] = count
        flag_row(depth, identity, sliver, j, view.width, flags)
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
                value = ground.wall
                if name >= 0 and kind[f] == 0:
                    value = grey[f]
                elif name >= 0 and kind[f] == TEXTURED | CELLS:
                    value = grey[f] * region_grey[cells[f, 3] + (name & _REGION_MASK)]
                elif name == FLOOR:
                    shade_floor(view, ground, seen, scratch, out, j, first, i)
                    continue
                elif name >= 0 and kind[f] == SMOOTH:
                    v = view.y + j + 0.5
                    a, b = shade[f, 0], shade[f, 1] * v + shade[f, 2]
                    c, d = inverse_depth[f, 0], inverse_depth[f, 1] * v + inverse_depth[f, 2]
                    for k in range(first, i):
                        u = view.x + k + 0.5
                        out[j, k] = quantised((a * u + b) / (c * u + d))
                    continue
                elif name >= 0:  # a picture, or cells on something round
                    v = view.y + j + 0.5
                    for k in range(first, i):
                        u = view.x + k + 0.5
                        w = inverse_depth[f, 0] * u + (inverse_depth[f, 1] * v + inverse_depth[f, 2])
                        value = grey[f]
                        if kind[f] & SMOOTH:
                            value = (shade[f, 0] * u + (shade[f, 1] * v + shade[f, 2])) / w
                        if kind[f] & CELLS:
                            value *= texels[cell_at(uv, cells, f, u, v, w)]
                        else:
                            value *= picture_at(
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
                                u,
                                v,
                            )
                        out[j, k] = quantised(value)
                    continue
                for k in range(first, i):
                    out[j, k] = quantised(value)
            while i < view.width and flags[i] != 0:
                mean, f = -1.0, identity[j, i] >> REGION_BITS
                if flags[i] == 1 and f >= 0:
                    if kind[f] == SMOOTH:
                        mean = mean_of_surface(
                            view, inverse_depth, shade, surface, kind, depth, identity, j, i
                        )
                    elif kind[f] == TEXTURED | CELLS and (
                        f
                        == identity[j, i + 1] >> REGION_BITS
                        == identity[j + 1, i] >> REGION_BITS
                        == identity[j + 1, i + 1] >> REGION_BITS
                    ):
                        x, y = view.x + i, view.y + j
                        mean = grey[f] * mean_of_cells(
                            uv, cells, inverse_depth, texels, f, x, y, cell_pattern, place
                        )
                if mean >= 0.0:
                    out[j, i] = quantised(mean)
                else:
                    column[count] = i
                    count += 1
                i += 1
    start[view.height] = count


@kernel
def flag_row(depth: Short, identity: Identities, sliver: Short, j: int, width: int, flags: Pixels) -> None:
    """Flag the pixels of row ``j`` whose corners differ (1) and that something may cross between them (2)."""
    for i in range(width):
        name = identity[j, i]
        differs = (name ^ identity[j, i + 1]) | (name ^ identity[j + 1, i]) | (name ^ identity[j + 1, i + 1])
        least = min(min(depth[j, i], depth[j, i + 1]), min(depth[j + 1, i], depth[j + 1, i + 1]))
        flags[i] = 2 * (sliver[j, i] > least) + (differs != 0)


@inlined
def mean_of_surface(
    view: View,
    inverse_depth: Array,
    shade: Array,
    surface: Indices,
    kind: Indices,
    depth: Short,
    identity: Identities,
    j: int,
    i: int,
) -> float:
    """Return the mean grey of a pixel's corners if they lie on one unbroken round surface, else -1."""
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
