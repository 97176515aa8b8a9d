"""A lens that distorts, in the form that kernels take (:class:`msrr_scenes.geometry.lens.Lens`)."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from msrr_perception.kernels.compiled import inlined, kernel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.lens import Lens

#: Steps of Newton's method, which converges quadratically, and the largest error that is left [px].
_STEPS = 7
_RESIDUAL_PX = 1e-6


class Optic(NamedTuple):
    """A lens. Where it does not distort, its other fields are not used."""

    distorts: bool
    focal: float  # [px]
    cx: float  # [px]
    cy: float  # [px]
    aspect: float
    k1: float
    k2: float
    p1: float
    p2: float
    k3: float


#: The lens of an ideal camera.
NO_LENS = Optic(False, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@lru_cache(maxsize=32)
def optic_of(lens: Lens) -> Optic:
    """Return a lens in the form that kernels take."""
    c, d = lens.camera, lens.distortion
    return Optic(lens.distorts, c.focal, c.cx, c.cy, d.aspect, d.k1, d.k2, d.p1, d.p2, d.k3)


@inlined
def distorted(optic: Optic, u: float, v: float) -> tuple[float, float]:
    """Return where the frame shows what the ideal camera sees at (u, v) [px]."""
    x, y = (u - optic.cx) / optic.focal, (v - optic.cy) / optic.focal
    r2 = x * x + y * y
    radial = 1.0 + r2 * (optic.k1 + r2 * (optic.k2 + r2 * optic.k3))
    bent_x = radial * x + 2.0 * optic.p1 * x * y + optic.p2 * (r2 + 2.0 * x * x)
    bent_y = radial * y + optic.p1 * (r2 + 2.0 * y * y) + 2.0 * optic.p2 * x * y
    return optic.focal * bent_x + optic.cx, optic.focal * optic.aspect * bent_y + optic.cy


@inlined
def undistorted(optic: Optic, u: float, v: float) -> tuple[float, float]:
    """Return where the ideal camera sees what the frame shows at (u, v) [px]; NaN if it was not found."""
    iu, iv = u, optic.cy + (v - optic.cy) / optic.aspect
    for _ in range(_STEPS):
        at_u, at_v = distorted(optic, iu, iv)
        eu, ev = at_u - u, (at_v - v) / optic.aspect
        x, y = (iu - optic.cx) / optic.focal, (iv - optic.cy) / optic.focal
        r2 = x * x + y * y
        radial = 1.0 + r2 * (optic.k1 + r2 * (optic.k2 + r2 * optic.k3))
        slope = 2.0 * (optic.k1 + r2 * (2.0 * optic.k2 + 3.0 * r2 * optic.k3))
        a = radial + slope * x * x + 2.0 * optic.p1 * y + 6.0 * optic.p2 * x
        b = slope * x * y + 2.0 * optic.p1 * x + 2.0 * optic.p2 * y
        d = radial + slope * y * y + 6.0 * optic.p1 * y + 2.0 * optic.p2 * x
        determinant = a * d - b * b
        iu, iv = iu - (d * eu - b * ev) / determinant, iv - (a * ev - b * eu) / determinant
    at_u, at_v = distorted(optic, iu, iv)
    if not (abs(at_u - u) < _RESIDUAL_PX and abs(at_v - v) < _RESIDUAL_PX):
        return np.nan, np.nan
    return iu, iv


@kernel
def undistort(optic: Optic, pixels: Array) -> Array:
    """Return where the ideal camera sees what the frame shows at ``pixels``, both of shape (N, 2)."""
    out = np.empty_like(pixels)
    for i in range(len(pixels)):
        out[i, 0], out[i, 1] = undistorted(optic, pixels[i, 0], pixels[i, 1])
    return out
