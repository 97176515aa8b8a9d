"""The floor's texture in the form that the kernels look up.

:meth:`msrr_bullet.render.floor.Floor.image` blends the two levels of the texture's pyramid next to a pixel's
footprint. Here the blends are made beforehand, in steps of half a level, and a pixel is one bilinear lookup
in the nearest of them. A texel is stored together with its neighbours to the right, below and diagonally, a
byte each, so that a lookup is one access to memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from msrr_bullet.render.raster.kernels.floor import STEPS
from msrr_bullet.render.raster.kernels.records import Floats, FloorTexture, Texels
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError


def pack_floor(levels: Sequence[Floats], period: float, wall: float) -> FloorTexture:
    """Return the floor's texture for the kernels.

    Args:
        levels: Texture pyramid, finest first [grey levels].
        period: Edge of the square that the texture covers before it repeats [m].
        wall: Grey level above the horizon.

    Raises:
        SceneError: The texture's edge is no power of two, or its greys do not lie in 0 to 255.
    """
    edge = levels[0].shape[0]
    halved = all(level.shape == (edge >> i, edge >> i) for i, level in enumerate(levels))
    if not halved or edge != 1 << (len(levels) - 1):
        raise SceneError(
            "the floor's texture is not a pyramid of squares, each half as wide, down to one texel"
        )
    if levels[0].min() < 0.0 or levels[0].max() > 255.0:
        raise SceneError("the floor's texture has grey levels outside 0 to 255")
    blends: list[Array] = []
    for fine, coarse in pairwise(levels):
        above = _doubled(coarse.astype(np.float64))
        blends += [fine + (k / STEPS) * (above - fine) for k in range(STEPS)]
    blends.append(levels[-1].astype(np.float64))
    sizes = np.array([blend.size for blend in blends], dtype=np.int64)
    return FloorTexture(
        texels=np.concatenate([_with_neighbours(blend).reshape(-1) for blend in blends]),
        start=np.cumsum(sizes) - sizes,
        bits=np.array([int(math.log2(len(blend))) for blend in blends], dtype=np.int64),
        wall=float(wall),
        per_metre=edge / period,
    )


def _doubled(level: Array) -> Array:
    """Return a periodic level at twice the resolution, by linear interpolation between texel centres."""
    out = level
    for axis in (0, 1):
        before, after = np.roll(out, 1, axis), np.roll(out, -1, axis)
        pair = np.stack([0.75 * out + 0.25 * before, 0.75 * out + 0.25 * after], axis=axis + 1)
        shape = list(out.shape)
        shape[axis] *= 2
        out = pair.reshape(shape)
    return out


def _with_neighbours(level: Array) -> Texels:
    """Return each texel with the next in its row, in its column and diagonally, from the lowest byte up."""
    own = np.rint(level).astype(np.uint32)
    pair = own | np.roll(own, -1, axis=1) << 8
    return (pair | np.roll(pair, -1, axis=0) << 16).astype(np.uint32)
