"""The floor: one lookup per pixel, in the blend of its texture that fits the pixel's footprint.

:mod:`msrr_bullet.render.raster.floor_texture` makes the blends.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.records import FloorTexture, FloorView, RowBuffers, View
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Blends per level of the texture's pyramid.
STEPS = 2

#: Pixels of a row that share one blend, aligned to the frame: for a camera with roll and for a level one.
ROLLED_STRIDE, _LEVEL_STRIDE = 32, 1024

#: Descent of a ray below which the floor is so far away that only its mean is seen.
_HORIZON = 1e-4


@inlined
def project_floor(texture: FloorTexture, view: View, R_WC: Array, p_WC: Array) -> FloorView:
    """Return the floor as seen by a camera; from below there is no floor (all forms zero)."""
    forms = np.zeros((3, 3))
    if p_WC[2] > 0.0:
        for i in range(3):
            # Of rays (x, y, 1): where they meet the floor, and how fast they fall.
            forms[0, i] = texture.per_metre * (p_WC[2] * R_WC[0, i] - p_WC[0] * R_WC[2, i])
            forms[1, i] = texture.per_metre * (p_WC[2] * R_WC[1, i] - p_WC[1] * R_WC[2, i])
            forms[2, i] = -R_WC[2, i]
        for k in range(3):  # of pixels, counted from their edges
            forms[k, 0] /= view.focal
            forms[k, 1] /= view.focal
            forms[k, 2] -= forms[k, 0] * view.middle_x + forms[k, 1] * view.middle_y
    lean = np.sqrt(R_WC[2, 0] * R_WC[2, 0] + R_WC[2, 1] * R_WC[2, 1])
    # A camera without roll sees each row of the floor at one distance.
    stride = _LEVEL_STRIDE if abs(R_WC[2, 0]) < 1e-3 else ROLLED_STRIDE
    return FloorView(forms, texture.per_metre * p_WC[2] / view.focal, lean, stride)


@inlined
def blend_at(
    texture: FloorTexture, seen: FloorView, column: int, row: int
) -> tuple[np.int32, np.int32, np.float32]:
    """Return first texel and bits of the blend for a pixel's group, and its edge over the finest one.

    The group is the run of pixels that share a blend. The footprint is the longer one, along the line of
    sight, of the group's middle.
    """
    u = (column // seen.stride) * seen.stride + 0.5 * seen.stride
    return blend_for(texture, seen, u, row + 0.5)


@inlined
def blend_for(
    texture: FloorTexture, seen: FloorView, u: float, v: float
) -> tuple[np.int32, np.int32, np.float32]:
    """Return what :func:`blend_at` returns for a group whose middle is at (u, v) in the image."""
    forms, last = seen.forms, len(texture.start) - 1
    t = max(forms[2, 0] * u + (forms[2, 1] * v + forms[2, 2]), _HORIZON)
    level = STEPS * np.log2(seen.scale * (t + seen.lean) / (t * t)) + 0.5
    blend = int(min(max(level, 0.0), float(last)))
    bits = texture.bits[blend]
    return np.int32(texture.start[blend]), np.int32(bits), np.float32((1 << bits) / (1 << texture.bits[0]))


@inlined
def floor_texel(
    x: np.float32, y: np.float32, t: np.float32, start: np.int32, bits: np.int32, shrink: np.float32
) -> tuple[np.int32, np.float32, np.float32]:
    """Return the index of the texel up and left of a point of the floor, and the point's offset from it.

    Args:
        x: Coordinate of the point in finest texels, times t.
        y: Likewise.
        t: Descent of the ray.
        start: First texel of the blend.
        bits: Binary logarithm of the blend's edge.
        shrink: Edge of the blend over that of the finest one.
    """
    mask = (np.int32(1) << bits) - np.int32(1)
    z = shrink / max(t, np.float32(_HORIZON))
    x, y = x * z - np.float32(0.5), y * z - np.float32(0.5)
    fx, fy = np.floor(x), np.floor(y)
    return start + ((np.int32(fy) & mask) << bits) + (np.int32(fx) & mask), x - fx, y - fy


@inlined
def bilinear_grey(texel: np.uint32, ax: np.float32, ay: np.float32) -> np.float32:
    """Return the grey level between a texel and its neighbours."""
    byte = np.uint32(255)
    a, b = np.float32(texel & byte), np.float32((texel >> np.uint32(8)) & byte)
    c, d = np.float32((texel >> np.uint32(16)) & byte), np.float32(texel >> np.uint32(24))
    upper, lower = a + ax * (b - a), c + ax * (d - c)
    return upper + ay * (lower - upper)


@subroutine
def shade_floor(
    view: View,
    texture: FloorTexture,
    seen: FloorView,
    buffers: RowBuffers,
    out: Pixels,
    j: int,
    first: int,
    end: int,
) -> None:
    """Write the floor into pixels ``first`` to ``end`` of row ``j``."""
    texels, forms, index, part_x, part_y = texture.texels, seen.forms, buffers.texel, buffers.x, buffers.y
    v = view.y + j + 0.5
    xu, yu, tu = np.float32(forms[0, 0]), np.float32(forms[1, 0]), np.float32(forms[2, 0])
    x = np.float32(forms[0, 1] * v + forms[0, 2])
    y = np.float32(forms[1, 1] * v + forms[1, 2])
    t = np.float32(forms[2, 1] * v + forms[2, 2])
    stop = first
    while stop < end:
        i = stop
        stop = min(((view.x + i) // seen.stride + 1) * seen.stride - view.x, end)
        start, bits, shrink = blend_at(texture, seen, view.x + i, view.y + j)
        for k in range(i, stop):
            u = np.float32(np.int32(view.x + k)) + np.float32(0.5)
            index[k], part_x[k], part_y[k] = floor_texel(
                xu * u + x, yu * u + y, tu * u + t, start, bits, shrink
            )
        for k in range(i, stop):  # apart from the loop above, which becomes vector code
            grey = bilinear_grey(texels[index[k]], part_x[k], part_y[k])
            out[j, k] = np.uint8(np.int32(grey + np.float32(0.5)))


@inlined
def floor_grey(texture: FloorTexture, seen: FloorView, column: int, row: int) -> float:
    """Return the floor's grey level in the middle of a pixel."""
    forms = seen.forms
    start, bits, shrink = blend_at(texture, seen, column, row)
    u, v = np.float32(column + 0.5), row + 0.5
    index, ax, ay = floor_texel(
        np.float32(forms[0, 0]) * u + np.float32(forms[0, 1] * v + forms[0, 2]),
        np.float32(forms[1, 0]) * u + np.float32(forms[1, 1] * v + forms[1, 2]),
        np.float32(forms[2, 0]) * u + np.float32(forms[2, 1] * v + forms[2, 2]),
        start,
        bits,
        shrink,
    )
    return float(bilinear_grey(texture.texels[index], ax, ay))
