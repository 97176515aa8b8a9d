"""The floor: one lookup per pixel, in the blend of its texture that fits the pixel's footprint.

:mod:`msrr_bullet.render.raster.floor_texture` makes the blends.
"""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.grid import GROUP, group_column, group_row, middle_column, middle_row
from msrr_bullet.render.raster.kernels.records import FloorTexture, FloorView, PixelGrid, RowBuffers, View
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels

#: Coefficients of a form, in single precision.
Form = tuple[np.float32, np.float32, np.float32]

#: Blends per level of the texture's pyramid.
STEPS = 2

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
    return FloorView(forms, texture.per_metre * p_WC[2] / view.focal, lean)


@inlined
def group_of(grid: PixelGrid, i: int) -> int:
    """Return the number of the group of pixels, in a row of the window, that pixel ``i`` is in."""
    return (grid.column + i) // GROUP - grid.column // GROUP


@inlined
def blend_for(
    texture: FloorTexture, seen: FloorView, u: float, v: float
) -> tuple[np.int32, np.int32, np.float32]:
    """Return first texel and bits of the blend for a group of pixels, and its edge over the finest one.

    The footprint is the longer one, along the line of sight, of the group's middle, which is at (u, v) in
    the image.
    """
    forms, last = seen.forms, len(texture.start) - 1
    t = max(forms[2, 0] * u + (forms[2, 1] * v + forms[2, 2]), _HORIZON)
    level = STEPS * np.log2(seen.scale * (t + seen.lean) / (t * t)) + 0.5
    blend = int(min(max(level, 0.0), float(last)))
    bits = texture.bits[blend]
    return np.int32(texture.start[blend]), np.int32(bits), np.float32((1 << bits) / (1 << texture.bits[0]))


@inlined
def single_forms(seen: FloorView) -> tuple[Form, Form, Form]:
    """Return the forms of x, y and t in single precision, as numbers that a loop keeps in registers."""
    forms = seen.forms
    return (
        (np.float32(forms[0, 0]), np.float32(forms[0, 1]), np.float32(forms[0, 2])),
        (np.float32(forms[1, 0]), np.float32(forms[1, 1]), np.float32(forms[1, 2])),
        (np.float32(forms[2, 0]), np.float32(forms[2, 1]), np.float32(forms[2, 2])),
    )


@inlined
def floor_texel(
    forms: tuple[Form, Form, Form],
    u: np.float32,
    v: np.float32,
    start: np.int32,
    bits: np.int32,
    shrink: np.float32,
) -> tuple[np.int32, np.float32, np.float32]:
    """Return the index of the texel up and left of a point of the floor, and the point's offset from it.

    Args:
        forms: Those of x, y and t of :class:`FloorView`.
        u: Column of the point in the image [px].
        v: Its row.
        start: First texel of the blend.
        bits: Binary logarithm of the blend's edge.
        shrink: Edge of the blend over that of the finest one.
    """
    x_form, y_form, t_form = forms
    mask = (np.int32(1) << bits) - np.int32(1)
    z = shrink / max(t_form[0] * u + (t_form[1] * v + t_form[2]), np.float32(_HORIZON))
    x = (x_form[0] * u + (x_form[1] * v + x_form[2])) * z - np.float32(0.5)
    y = (y_form[0] * u + (y_form[1] * v + y_form[2])) * z - np.float32(0.5)
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
    grid: PixelGrid,
    texture: FloorTexture,
    seen: FloorView,
    buffers: RowBuffers,
    out: Pixels,
    k: int,
    first: int,
    end: int,
) -> None:
    """Write the floor into pixels ``first`` to ``end`` of ``out``, which is row ``k`` of the window."""
    texels, index, part_x, part_y = texture.texels, buffers.texel, buffers.x, buffers.y
    u, v, forms = grid.u, grid.v, single_forms(seen)
    stop = first
    while stop < end:
        i, group = stop, group_of(grid, stop)
        stop = min(i + GROUP - (grid.column + i) % GROUP, end)
        start, bits, shrink = blend_for(
            texture, seen, group_column(grid.group_u, k, group), group_row(grid.group_v, k, group)
        )
        for n in range(i, stop):
            index[n], part_x[n], part_y[n] = floor_texel(
                forms,
                np.float32(middle_column(u, k, n)),
                np.float32(middle_row(v, k, n)),
                start,
                bits,
                shrink,
            )
        for n in range(i, stop):  # apart from the loop above, which becomes vector code
            grey = bilinear_grey(texels[index[n]], part_x[n], part_y[n])
            out[n] = np.uint8(np.int32(grey + np.float32(0.5)))


@inlined
def floor_grey(grid: PixelGrid, texture: FloorTexture, seen: FloorView, k: int, i: int) -> float:
    """Return the floor's grey level in the middle of pixel (k, i) of the window."""
    group = group_of(grid, i)
    start, bits, shrink = blend_for(
        texture, seen, group_column(grid.group_u, k, group), group_row(grid.group_v, k, group)
    )
    u, v = np.float32(middle_column(grid.u, k, i)), np.float32(middle_row(grid.v, k, i))
    index, ax, ay = floor_texel(single_forms(seen), u, v, start, bits, shrink)
    return float(bilinear_grey(texture.texels[index], ax, ay))
