"""Radius and track of a unit, from the collision shapes of its wheels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid

#: Links of the driven wheels; a link of another name, such as ``wheel_rear``, is none.
WHEEL_LINKS = ("wheel_left", "wheel_right")

#: Largest distance of the frame axle, or of a shape of a wheel, from where it belongs [m].
_TOLERANCE_M = 1e-3

#: Largest difference between the radii of the wheels, a rounding of a drawing [m]. Odometry and controllers
#: know of one radius alone.
_EQUAL_M = 1e-5

#: Least cosine between the axis of a cylinder and that of its wheel, 1 degree apart.
_ALONG = math.cos(math.radians(1.0))


def measure_wheels(path: Path, frames: Mapping[str, SE3], solids: Iterable[Solid]) -> tuple[float, float]:
    """Return the radius of the wheels, and the distance between their contact points [m].

    ``frames`` has ``X_UF`` of every link F. The URDF is named in messages.

    Raises:
        GeometryError: A wheel has no round shape about its axis, the wheels differ, or the frame axle is not
            on the ground under the middle between them.
    """
    tyres = [_tyre(path, frames[name], name, solids) for name in ("wheel_left", "wheel_right")]
    radii = [tyre.size[0] for tyre in tyres]
    if abs(radii[0] - radii[1]) > _EQUAL_M:
        raise GeometryError(
            f"{path}: the wheels have radii of {radii[0]:g} m and {radii[1]:g} m; make them equal. Wheels "
            "that are not as designed are radius_left_percent and radius_right_percent of as_built.drive"
        )
    _check_axle(path, tyres[0].X_UG.p, tyres[1].X_UG.p, radii[0])
    return radii[0], float(tyres[0].X_UG.p[1] - tyres[1].X_UG.p[1])


def _tyre(path: Path, X_UL: SE3, wheel: str, solids: Iterable[Solid]) -> Solid:
    """Return the shape on which a wheel rolls: the round one with the largest radius."""
    round_ = [s for s in solids if s.link == wheel and s.kind in ("sphere", "cylinder")]
    if not round_:
        raise GeometryError(
            f"{path}: {wheel!r} has no radius; its collision shape has to be a sphere or a cylinder, and in "
            "that link itself, not in one that is joined to it"
        )
    tyre = max(round_, key=lambda solid: solid.size[0])
    off = (tyre.X_UG.p - X_UL.p)[[0, 2]]
    if np.abs(off).max() > _TOLERANCE_M:
        raise GeometryError(
            f"{path}: the collision shape of {wheel!r} is ({off[0]:z.4f}, {off[1]:z.4f}) m off its axis, "
            "forward and up, so that the wheel would wobble; correct the <origin> of the shape"
        )
    if tyre.kind == "cylinder" and abs(tyre.X_UG.R[1, 2]) < _ALONG:
        axis = ", ".join(f"{value:z.3f}" for value in tyre.X_UG.R[:, 2])
        raise GeometryError(
            f"{path}: the collision shape of {wheel!r}, a cylinder, has its axis along ({axis}) of the frame "
            "axle, and not along y; z of a cylinder is its axis, so turn its <origin>"
        )
    return tyre


def _check_axle(path: Path, left: Array, right: Array, radius: float) -> None:
    """Refuse an axle that is not on the ground under the middle between the wheels."""
    x, y, z = 0.5 * (left + right) - [0.0, 0.0, radius]
    if max(abs(x), abs(y), abs(z)) > _TOLERANCE_M or left[1] <= right[1]:
        found = f"the left wheel is at y = {left[1]:.4f} m, the right one at {right[1]:.4f}: swap the two"
        if left[1] > right[1]:
            found = f"that point is at ({x:z.4f}, {y:z.4f}, {z:z.4f}) m in it"
        raise GeometryError(
            f"{path}: the frame axle has to be on the ground under the middle between the wheels, x forward; "
            f"{found}. In a scene: frames: {{axle: {{link: ..., x_m: ..., z_m: ...}}}}"
        )
