"""The background under the kernels: the floor's texture, filtered to each pixel's footprint.

The same picture as :meth:`msrr_bullet.render.floor.Floor.image`. There, a pixel blends the two levels of the
texture's pyramid next to its footprint. Here the blends are made beforehand, in steps of half a level, and a
pixel is one bilinear lookup in the nearest of them. A texel is kept together with its neighbours to the
right, below and diagonally, a byte each, so that a lookup is one access to memory.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.floor import Floor
from msrr_bullet.render.raster.kernels.compiled import inlined, kernel
from msrr_bullet.render.raster.kernels.records import Ground, GroundView, Pixels, Scratch, Texels, View
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError

#: Blends per level of the pyramid.
STEPS = 2

#: Pixels of a row that share one blend, aligned to the frame: for a camera with roll and for a level one.
_ROLLED_STRIDE, _LEVEL_STRIDE = 32, 1024

#: Descent of a ray below which the floor is so far away that only its mean is seen.
_HORIZON = 1e-4


@lru_cache(maxsize=4)
def ground_of(floor: Floor) -> Ground:
    """Return a floor's texture as the kernels want it.

    Raises:
        SceneError: The texture's edge is no power of two, or its greys do not lie in 0 to 255.
    """
    edge = floor.levels[0].shape[0]
    halved = all(level.shape == (edge >> i, edge >> i) for i, level in enumerate(floor.levels))
    if not halved or edge != 1 << (len(floor.levels) - 1):
        raise SceneError(
            "the floor's texture is not a pyramid of squares, each half as wide, down to one texel"
        )
    if floor.levels[0].min() < 0.0 or floor.levels[0].max() > 255.0:
        raise SceneError("the floor's texture has grey levels outside 0 to 255")
    blends: list[NDArray[np.float64]] = []
    for fine, coarse in zip(floor.levels, floor.levels[1:], strict=False):
        above = _doubled(coarse.astype(np.float64))
        blends += [fine + (k / STEPS) * (above - fine) for k in range(STEPS)]
    blends.append(floor.levels[-1].astype(np.float64))
    sizes = np.array([blend.size for blend in blends], dtype=np.int64)
    return Ground(
        texels=np.concatenate([_with_neighbours(blend).reshape(-1) for blend in blends]),
        start=np.cumsum(sizes) - sizes,
        bits=np.array([int(math.log2(len(blend))) for blend in blends], dtype=np.int64),
        mean=float(floor.levels[-1][0, 0]),
        wall=float(floor.wall),
        per_metre=edge / floor.period,
    )


def _doubled(level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a periodic level at twice the resolution, by linear interpolation between texel centres."""
    out = level
    for axis in (0, 1):
        before, after = np.roll(out, 1, axis), np.roll(out, -1, axis)
        pair = np.stack([0.75 * out + 0.25 * before, 0.75 * out + 0.25 * after], axis=axis + 1)
        shape = list(out.shape)
        shape[axis] *= 2
        out = pair.reshape(shape)
    return out


def _with_neighbours(level: NDArray[np.float64]) -> Texels:
    """Return each texel with the next in its row, in its column and diagonally, from the lowest byte up."""
    own = np.rint(level).astype(np.uint32)
    right = np.roll(own, -1, axis=1)
    pair = own | right << 8
    return (pair | np.roll(pair, -1, axis=0) << 16).astype(np.uint32)


@inlined
def view_ground(
    ground: Ground, focal: float, middle_x: float, middle_y: float, R_WC: Array, p_WC: Array
) -> GroundView:
    """Return a floor as seen by a camera; from below there is no floor (all forms zero)."""
    forms = np.zeros((3, 3))
    if p_WC[2] > 0.0:
        for i in range(3):
            # Of rays (x, y, 1): where they meet the floor, and how fast they fall.
            forms[0, i] = ground.per_metre * (p_WC[2] * R_WC[0, i] - p_WC[0] * R_WC[2, i])
            forms[1, i] = ground.per_metre * (p_WC[2] * R_WC[1, i] - p_WC[1] * R_WC[2, i])
            forms[2, i] = -R_WC[2, i]
        for k in range(3):  # of pixels, counted from their edges
            forms[k, 0] /= focal
            forms[k, 1] /= focal
            forms[k, 2] -= forms[k, 0] * middle_x + forms[k, 1] * middle_y
    lean = np.sqrt(R_WC[2, 0] * R_WC[2, 0] + R_WC[2, 1] * R_WC[2, 1])
    # A camera without roll sees each row of the floor at one distance.
    stride = _LEVEL_STRIDE if abs(R_WC[2, 0]) < 1e-3 else _ROLLED_STRIDE
    return GroundView(forms, ground.per_metre * p_WC[2] / focal, lean, stride)


@inlined
def ground_blend(
    forms: Array, scale: float, lean: float, stride: int, last: int, column: int, row: int
) -> int:
    """Return which blend the group of pixels that holds (column, row) is looked up in.

    The footprint is the longer one, along the line of sight.
    """
    u = (column // stride) * stride + 0.5 * stride
    t = max(forms[2, 0] * u + (forms[2, 1] * (row + 0.5) + forms[2, 2]), _HORIZON)
    return int(min(max(STEPS * np.log2(scale * (t + lean) / (t * t)) + 0.5, 0.0), float(last)))


@inlined
def texel_place(
    x: np.float32, y: np.float32, t: np.float32, start: np.int32, bits: np.int32, shrink: np.float32
) -> tuple[np.int32, np.float32, np.float32]:
    """Return where the texel up and left of a point of the floor is, and how far on the point lies.

    Args:
        x: Of the point in finest texels, times t.
        y: Likewise.
        t: Descent of the ray.
        start: First texel of the blend.
        bits: Binary logarithm of the blend's edge.
        shrink: That edge over the finest one.
    """
    mask = (np.int32(1) << bits) - np.int32(1)
    z = shrink / max(t, np.float32(_HORIZON))
    x, y = x * z - np.float32(0.5), y * z - np.float32(0.5)
    fx, fy = np.floor(x), np.floor(y)
    return start + ((np.int32(fy) & mask) << bits) + (np.int32(fx) & mask), x - fx, y - fy


@inlined
def interpolated(texel: np.uint32, ax: np.float32, ay: np.float32) -> np.float32:
    """Return the grey between a texel and its neighbours."""
    byte = np.uint32(255)
    a, b = np.float32(texel & byte), np.float32((texel >> np.uint32(8)) & byte)
    c, d = np.float32((texel >> np.uint32(16)) & byte), np.float32(texel >> np.uint32(24))
    upper, lower = a + ax * (b - a), c + ax * (d - c)
    return upper + ay * (lower - upper)


@kernel
def shade_floor(
    view: View, ground: Ground, seen: GroundView, scratch: Scratch, out: Pixels, j: int, first: int, end: int
) -> None:
    """Write the floor into pixels ``first`` to ``end`` of row ``j``."""
    texels, forms, place, part_x, part_y = ground.texels, seen.forms, scratch.place, scratch.x, scratch.y
    v = view.y + j + 0.5
    xu, yu, tu = np.float32(forms[0, 0]), np.float32(forms[1, 0]), np.float32(forms[2, 0])
    x = np.float32(forms[0, 1] * v + forms[0, 2])
    y = np.float32(forms[1, 1] * v + forms[1, 2])
    t = np.float32(forms[2, 1] * v + forms[2, 2])
    stop = first
    while stop < end:
        i = stop
        stop = min(((view.x + i) // seen.stride + 1) * seen.stride - view.x, end)
        start, bits, shrink = blend_of(ground, seen, view.x + i, view.y + j)
        for k in range(i, stop):
            u = np.float32(np.int32(view.x + k)) + np.float32(0.5)
            place[k], part_x[k], part_y[k] = texel_place(
                xu * u + x, yu * u + y, tu * u + t, start, bits, shrink
            )
        for k in range(i, stop):  # apart from the loop above, which becomes vector code
            grey = interpolated(texels[place[k]], part_x[k], part_y[k])
            out[j, k] = np.uint8(np.int32(grey + np.float32(0.5)))


@inlined
def blend_of(
    ground: Ground, seen: GroundView, column: int, row: int
) -> tuple[np.int32, np.int32, np.float32]:
    """Return first texel and bits of the blend for a pixel's group, and its edge over the finest one."""
    last = len(ground.start) - 1
    blend = ground_blend(seen.forms, seen.scale, seen.lean, seen.stride, last, column, row)
    bits = ground.bits[blend]
    return np.int32(ground.start[blend]), np.int32(bits), np.float32((1 << bits) / (1 << ground.bits[0]))


@inlined
def floor_at(ground: Ground, seen: GroundView, column: int, row: int) -> float:
    """Return the floor's grey in the middle of a pixel."""
    forms = seen.forms
    start, bits, shrink = blend_of(ground, seen, column, row)
    u, v = np.float32(column + 0.5), row + 0.5
    place, ax, ay = texel_place(
        np.float32(forms[0, 0]) * u + np.float32(forms[0, 1] * v + forms[0, 2]),
        np.float32(forms[1, 0]) * u + np.float32(forms[1, 1] * v + forms[1, 2]),
        np.float32(forms[2, 0]) * u + np.float32(forms[2, 1] * v + forms[2, 2]),
        start,
        bits,
        shrink,
    )
    return float(interpolated(ground.texels[place], ax, ay))
