"""Settled pixels: those whose corners agree get the grey level of what they show, the others are listed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.raster.compiled import inlined, kernel
from msrr_bullet.render.raster.ground import STRIDE, Ground, GroundView, ground_blend, ground_grey
from msrr_bullet.render.raster.picture import Textures, picture_at
from msrr_bullet.render.raster.projection import CELLS, SMOOTH, TEXTURED, Faces, Indices, View
from msrr_bullet.render.raster.visibility import FLOOR, REGION_BITS, Corners, Depths, Identities, cell_at

Pixels = NDArray[np.uint8]

_REGION_MASK = (1 << REGION_BITS) - 1


class Samples(NamedTuple):
    """The open pixels (P) of a band of rows, and their samples (S)."""

    start: Indices  # (height + 1,) first open pixel of each row
    column: Identities  # (P,) from the window's left
    depth: Depths  # (P, S) 1 / z of the nearest face
    identity: Identities  # (P, S)
    farthest: Depths  # (P,) smallest of ``depth``


@inlined
def quantised(grey: float) -> np.uint8:
    """Return the nearest of the 256 grey levels."""
    return np.uint8(min(max(grey, 0.0), 255.0) + 0.5)


@kernel
def pictured(faces: Faces, textures: Textures, f: int, u: float, v: float) -> float:
    """Return the grey level at (u, v) of a face that wears a picture, or is both round and textured."""
    w = faces.inverse_depth[f, 0] * u + (faces.inverse_depth[f, 1] * v + faces.inverse_depth[f, 2])
    grey = faces.grey[f]
    if faces.kind[f] & SMOOTH:
        grey = (faces.shade[f, 0] * u + (faces.shade[f, 1] * v + faces.shade[f, 2])) / w
    if faces.kind[f] & CELLS:
        return grey * textures.texels[cell_at(faces.uv, faces.cells, f, u, v, w)]
    if faces.kind[f] & TEXTURED:
        return grey * picture_at(faces, textures, f, u, v, w)
    return grey


@kernel
def settle(view: View, corners: Corners, settled: Identities, samples: Samples) -> None:
    """Sort pixels into settled and open ones.

    Args:
        view: Camera and window.
        corners: Of the window, all faces drawn.
        settled: Filled with the identity of each settled pixel and of one corner of each open one, shape
            (height, width).
        samples: Its lists of open pixels are filled.
    """
    depth, identity, sliver = corners.depth, corners.identity, corners.sliver
    start, column = samples.start, samples.column
    count = 0
    for j in range(view.height):
        start[j] = count
        for i in range(view.width):
            name = identity[j, i]
            differs = (
                (name ^ identity[j, i + 1]) | (name ^ identity[j + 1, i]) | (name ^ identity[j + 1, i + 1])
            ) != 0
            if sliver[j, i] > np.float32(0.0):
                differs |= sliver[j, i] > min(
                    min(depth[j, i], depth[j, i + 1]), min(depth[j + 1, i], depth[j + 1, i + 1])
                )
            settled[j, i] = name
            column[count] = i
            count += differs
    start[view.height] = count


@kernel
def shade_settled(
    view: View,
    faces: Faces,
    textures: Textures,
    ground: Ground,
    seen: GroundView,
    settled: Identities,
    out: Pixels,
) -> None:
    """Write every pixel as if what one corner shows filled it (open pixels are written again)."""
    kind, grey, cells, region_grey = faces.kind, faces.grey, faces.cells, textures.region_grey
    shade, inverse_depth = faces.shade, faces.inverse_depth
    for j in range(view.height):
        v = view.y + j + 0.5
        stop = 0
        while stop < view.width:  # runs of one identity
            i, name = stop, settled[j, stop]
            while stop < view.width and settled[j, stop] == name:
                stop += 1
            f = name >> REGION_BITS
            if name == FLOOR:
                shade_floor(view, ground, seen, out, j, i, stop)
            elif name < 0 or kind[f] == 0 or kind[f] == TEXTURED | CELLS:
                value = quantised(ground.wall)
                if name >= 0:
                    reflected = 1.0
                    if kind[f] != 0:
                        reflected = region_grey[cells[f, 3] + (name & _REGION_MASK)]
                    value = quantised(grey[f] * reflected)
                for k in range(i, stop):
                    out[j, k] = value
            elif kind[f] == SMOOTH:
                a, b = shade[f, 0], shade[f, 1] * v + shade[f, 2]
                c, d = inverse_depth[f, 0], inverse_depth[f, 1] * v + inverse_depth[f, 2]
                for k in range(i, stop):
                    u = view.x + k + 0.5
                    out[j, k] = quantised((a * u + b) / (c * u + d))
            else:
                for k in range(i, stop):
                    out[j, k] = quantised(pictured(faces, textures, f, view.x + k + 0.5, v))


@kernel
def shade_floor(
    view: View, ground: Ground, seen: GroundView, out: Pixels, j: int, first: int, end: int
) -> None:
    """Write the floor into pixels ``first`` to ``end`` of row ``j``."""
    texels, forms, last = ground.texels, seen.forms, len(ground.start) - 1
    v = view.y + j + 0.5
    xu, yu, tu = forms[0, 0], forms[1, 0], forms[2, 0]
    x, y, t = (
        forms[0, 1] * v + forms[0, 2],
        forms[1, 1] * v + forms[1, 2],
        forms[2, 1] * v + forms[2, 2],
    )
    stop = first
    while stop < end:
        i = stop
        stop = min(((view.x + i) // STRIDE + 1) * STRIDE - view.x, end)
        blend = ground_blend(forms, seen.scale, seen.lean, last, view.x + i, view.y + j)
        start, bits = ground.start[blend], ground.bits[blend]
        shrink = (1 << bits) / (1 << ground.bits[0])
        for k in range(i, stop):
            u = view.x + k + 0.5
            out[j, k] = quantised(ground_grey(texels, start, bits, shrink, xu * u + x, yu * u + y, tu * u + t))


@kernel
def floor_at(ground: Ground, seen: GroundView, column: int, row: int) -> float:
    """Return the floor's grey in the middle of a pixel."""
    forms = seen.forms
    blend = ground_blend(forms, seen.scale, seen.lean, len(ground.start) - 1, column, row)
    bits = ground.bits[blend]
    shrink = (1 << bits) / (1 << ground.bits[0])
    u, v = column + 0.5, row + 0.5
    return ground_grey(
        ground.texels,
        ground.start[blend],
        bits,
        shrink,
        forms[0, 0] * u + (forms[0, 1] * v + forms[0, 2]),
        forms[1, 0] * u + (forms[1, 1] * v + forms[1, 2]),
        forms[2, 0] * u + (forms[2, 1] * v + forms[2, 2]),
    )
