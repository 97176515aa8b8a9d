"""The background under the kernels: the floor's texture, filtered to each pixel's footprint.

The same picture as :meth:`msrr_bullet.render.floor.Floor.image`. There, a pixel blends the two levels of the
texture's pyramid next to its footprint. Here the blends are made beforehand, in steps of a quarter of a level,
and a pixel is one bilinear lookup in the nearest of them.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.floor import Floor
from msrr_bullet.render.raster.compiled import inlined
from msrr_bullet.render.raster.projection import Array, Indices
from msrr_scenes.errors import SceneError
from msrr_scenes.se3 import SE3

Texels = NDArray[np.uint16]

#: Blends per level of the pyramid.
STEPS = 4

#: Texels are kept as grey levels times this.
_UNIT = 128.0

#: Pixels of a row that share one blend, aligned to the frame.
STRIDE = 32

#: Descent of a ray below which the floor is so far away that only its mean is seen.
_HORIZON = 1e-4


class Ground(NamedTuple):
    """A floor as the kernels see it."""

    texels: Texels  # all blends, finest first, row by row
    start: Indices  # (B,) first texel of each blend
    bits: Indices  # (B,) binary logarithm of its edge
    mean: float
    wall: float
    per_metre: float  # finest texels per metre


class GroundView(NamedTuple):
    """A floor seen from a camera.

    With t the descent of a pixel's ray, x / t and y / t are the point of the floor in finest texels.
    """

    forms: Array  # (3, 3) forms of x, y and t over the image
    scale: float  # footprint across a ray that falls plumb [texels]
    lean: float  # sine of the angle between optical axis and plumb line


@lru_cache(maxsize=4)
def ground_of(floor: Floor) -> Ground:
    """Return a floor's texture as the kernels want it.

    Raises:
        SceneError: The texture's edge is no power of two, or its greys do not lie in 0 to 255.
    """
    edge = floor.levels[0].shape[0]
    if any(level.shape != (edge >> i, edge >> i) for i, level in enumerate(floor.levels)) or edge & (edge - 1):
        raise SceneError("the floor's texture is not a pyramid of squares, each half as wide, from a power of two")
    if floor.levels[0].min() < 0.0 or floor.levels[0].max() > 255.0:
        raise SceneError("the floor's texture has grey levels outside 0 to 255")
    blends: list[NDArray[np.float64]] = []
    for fine, coarse in zip(floor.levels, floor.levels[1:], strict=False):
        above = _doubled(coarse.astype(np.float64))
        blends += [fine + (k / STEPS) * (above - fine) for k in range(STEPS)]
    blends.append(floor.levels[-1].astype(np.float64))
    sizes = np.array([blend.size for blend in blends], dtype=np.int64)
    return Ground(
        texels=np.concatenate([np.rint(_UNIT * blend).astype(np.uint16).reshape(-1) for blend in blends]),
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


def view_ground(ground: Ground, focal: float, middle: tuple[float, float], X_WC: SE3) -> GroundView:
    """Return a floor as seen by a camera at ``X_WC``; from below there is no floor (all forms zero)."""
    r, p = X_WC.R, X_WC.p
    forms = np.zeros((3, 3))
    if p[2] <= 0.0:
        return GroundView(forms, 1.0, 0.0)
    forms[0] = ground.per_metre * (p[2] * r[0] - p[0] * r[2])
    forms[1] = ground.per_metre * (p[2] * r[1] - p[1] * r[2])
    forms[2] = -r[2]
    # From rays (x, y, 1) to pixels, counted from their edges.
    forms[:, :2] /= focal
    forms[:, 2] -= forms[:, 0] * middle[0] + forms[:, 1] * middle[1]
    scale = ground.per_metre * float(p[2]) / focal
    return GroundView(forms, scale, math.hypot(r[2, 0], r[2, 1]))


@inlined
def ground_blend(forms: Array, scale: float, lean: float, last: int, column: int, row: int) -> int:
    """Return which blend the group of pixels that holds (column, row) is looked up in.

    The footprint is the longer one, along the line of sight.
    """
    u = (column // STRIDE) * STRIDE + 0.5 * STRIDE
    t = max(forms[2, 0] * u + (forms[2, 1] * (row + 0.5) + forms[2, 2]), _HORIZON)
    return int(min(max(STEPS * np.log2(scale * (t + lean) / (t * t)) + 0.5, 0.0), float(last)))


@inlined
def ground_grey(
    texels: Texels, start: int, bits: int, shrink: float, x: float, y: float, t: float
) -> np.float32:
    """Return the floor's grey at (x / t, y / t) finest texels.

    Args:
        texels: All blends.
        start: First texel of the blend to look it up in.
        bits: Binary logarithm of that blend's edge.
        shrink: That edge over the finest one.
        x: Of the floor, times t.
        y: Of the floor, times t.
        t: Descent of the ray.
    """
    z = shrink / max(t, _HORIZON)
    x, y = x * z - 0.5, y * z - 0.5
    fx, fy = np.floor(x), np.floor(y)
    ax, ay = np.float32(x - fx), np.float32(y - fy)
    mask = (1 << bits) - 1
    i0, j0 = int(fx) & mask, int(fy) & mask
    i1, j1 = (i0 + 1) & mask, (j0 + 1) & mask
    upper, lower = start + (j0 << bits), start + (j1 << bits)
    a, b = np.float32(texels[upper + i0]), np.float32(texels[upper + i1])
    c, d = np.float32(texels[lower + i0]), np.float32(texels[lower + i1])
    a += ax * (b - a)
    c += ax * (d - c)
    return (a + ay * (c - a)) * np.float32(1.0 / _UNIT)
