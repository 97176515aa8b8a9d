"""The floor's texture in the form that the kernels look up.

:meth:`msrr_bullet.render.floor.Floor.image` blends the two levels of the texture's pyramid next to a pixel's
footprint. Here the blends are made beforehand, in steps of half a level, and a pixel is one bilinear lookup
in the nearest of them. A texel is stored together with its neighbours to the right, below and diagonally, a
byte each, so that a lookup is one access to memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from msrr_bullet.render.raster.kernels.floor import STEPS
from msrr_bullet.render.raster.kernels.records import Floats, FloorTexture, Texels
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.messages import Pixels


def pack_floor(levels: Sequence[Floats], period: float, wall: float) -> FloorTexture:
    """Return the floor's texture for the kernels.

    ``levels`` is the texture pyramid, finest first [grey levels]; all else is as in
    :class:`msrr_bullet.render.floor.Floor`.

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
    bits = np.append(np.repeat(np.arange(len(levels) - 1, 0, -1), STEPS), 0)  # of each blend's edge
    sizes = 1 << 2 * bits
    start = np.cumsum(sizes) - sizes
    texels = np.empty(sizes.sum(), dtype=np.uint32)
    for blend, first in zip(_blends(levels), start, strict=True):
        texels[first : first + blend.size] = _with_neighbours(blend).reshape(-1)
    return FloorTexture(texels, start, bits, float(wall), edge / period)


def _blends(levels: Sequence[Floats]) -> Iterator[Pixels]:
    """Yield the blends, finest first, in whole grey levels; one at a time, for they are large."""
    for fine, coarse in pairwise(levels):
        rise = _doubled(coarse.astype(np.float64)) - fine
        for k in range(STEPS):
            yield np.rint(fine + (k / STEPS) * rise).astype(np.uint8)
    yield np.rint(levels[-1]).astype(np.uint8)


def _doubled(level: Array) -> Array:
    """Return a periodic level at twice the resolution, by linear interpolation between texel centres."""
    n = len(level)
    down, out = np.empty((2 * n, n)), np.empty((2 * n, 2 * n))
    for axis, given, even, odd in ((0, level, down[0::2], down[1::2]), (1, down, out[:, 0::2], out[:, 1::2])):
        near, far = 0.75 * given, 0.25 * given
        np.add(near, np.roll(far, 1, axis), out=even)
        np.add(near, np.roll(far, -1, axis), out=odd)
    return out


def _with_neighbours(level: Pixels) -> Texels:
    """Return each texel with the next in its row, in its column and diagonally, from the lowest byte up."""
    texels = level.astype(np.uint32)
    texels |= np.roll(texels, -1, axis=1) << 8
    texels |= np.roll(texels, -1, axis=0) << 16
    return texels
