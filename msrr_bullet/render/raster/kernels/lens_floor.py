"""The floor through a lens that distorts: as in :mod:`.floor`, at the undistorted middles of the pixels."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, subroutine
from msrr_bullet.render.raster.kernels.floor import ROLLED_STRIDE, bilinear_grey, blend_for, floor_texel
from msrr_bullet.render.raster.kernels.records import FloorTexture, FloorView, LensView, RowBuffers
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Pixels


@inlined
def group_of(view: LensView, i: int) -> int:
    """Return the number of the group of pixels, in a row of the window, that pixel ``i`` is in."""
    return (view.column + i) // ROLLED_STRIDE - view.column // ROLLED_STRIDE


@inlined
def middle_of(corners: Array, k: int, i: int) -> float:
    """Return the mean of a coordinate of the four corners of pixel (k, i) of the window."""
    return 0.25 * ((corners[k, i] + corners[k, i + 1]) + (corners[k + 1, i] + corners[k + 1, i + 1]))


@subroutine
def shade_lens_floor(
    view: LensView,
    texture: FloorTexture,
    seen: FloorView,
    buffers: RowBuffers,
    out: Pixels,
    k: int,
    first: int,
    end: int,
) -> None:
    """Write the floor into pixels ``first`` to ``end`` of ``out``, which is row ``k`` of the window."""
    texels, forms, index, part_x, part_y = texture.texels, seen.forms, buffers.texel, buffers.x, buffers.y
    corners_u, corners_v = view.u, view.v
    xu, xv, x0 = np.float32(forms[0, 0]), np.float32(forms[0, 1]), np.float32(forms[0, 2])
    yu, yv, y0 = np.float32(forms[1, 0]), np.float32(forms[1, 1]), np.float32(forms[1, 2])
    tu, tv, t0 = np.float32(forms[2, 0]), np.float32(forms[2, 1]), np.float32(forms[2, 2])
    stop = first
    while stop < end:
        i, group = stop, group_of(view, stop)
        stop = min(i + ROLLED_STRIDE - (view.column + i) % ROLLED_STRIDE, end)
        start, bits, shrink = blend_for(texture, seen, view.group_u[k, group], view.group_v[k, group])
        for n in range(i, stop):
            u, v = np.float32(middle_of(corners_u, k, n)), np.float32(middle_of(corners_v, k, n))
            index[n], part_x[n], part_y[n] = floor_texel(
                xu * u + (xv * v + x0), yu * u + (yv * v + y0), tu * u + (tv * v + t0), start, bits, shrink
            )
        for n in range(i, stop):  # apart from the loop above, which becomes vector code
            grey = bilinear_grey(texels[index[n]], part_x[n], part_y[n])
            out[n] = np.uint8(np.int32(grey + np.float32(0.5)))


@inlined
def floor_grey_at(view: LensView, texture: FloorTexture, seen: FloorView, k: int, i: int) -> float:
    """Return the floor's grey level in the middle of pixel (k, i) of the window."""
    forms, group = seen.forms, group_of(view, i)
    start, bits, shrink = blend_for(texture, seen, view.group_u[k, group], view.group_v[k, group])
    u, v = np.float32(middle_of(view.u, k, i)), np.float32(middle_of(view.v, k, i))
    index, ax, ay = floor_texel(
        np.float32(forms[0, 0]) * u + (np.float32(forms[0, 1]) * v + np.float32(forms[0, 2])),
        np.float32(forms[1, 0]) * u + (np.float32(forms[1, 1]) * v + np.float32(forms[1, 2])),
        np.float32(forms[2, 0]) * u + (np.float32(forms[2, 1]) * v + np.float32(forms[2, 2])),
        start,
        bits,
        shrink,
    )
    return float(bilinear_grey(texture.texels[index], ax, ay))
