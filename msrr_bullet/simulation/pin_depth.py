"""How deep the pins of an active port are in the holes of a passive port in PyBullet."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from msrr_bullet.plant.lock_actuator import TILT_M
from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.unit_body import UnitBody
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import GeometryError
from msrr_scenes.specs.plan import DockStep

SIDES = ("left", "right")

#: Margin of a bound on a distance [m], far more than rounding.
_ROUNDING_M = 1e-9

#: A collision shape of PyBullet with position [m] and quaternion xyzw in the inertial frame of a unit's root.
_Shape = tuple[int, tuple[list[float], list[float]]]


class PinDepths:
    """Measures the distance of both pins, the left one first, from the bottoms of their holes."""

    def __init__(self, world: BulletWorld, step: DockStep, reach_m: float) -> None:
        """Look up the pins of the docking unit and the holes of the port that it docks to.

        A pin farther away than ``reach_m`` counts as infinitely far.

        Raises:
            GeometryError: A URDF has no pins, or no holes at the passive port.
        """
        self._world, self._step, self._reach_m = world, step, reach_m
        self._unit, self._target = world.unit(step.unit), world.unit(step.target_unit)
        self.pins = tuple(self._pin(side) for side in SIDES)
        self._bottoms = tuple(self._bottom(side) for side in SIDES)
        self._pin_circles = [_circle(self._unit, f"pin_{side}") for side in SIDES]
        self._bottom_circles = [_circle(self._target, self._hole(side)) for side in SIDES]
        self._names = step.unit, step.target_unit
        self._apart_m = reach_m + 2.0 * TILT_M  # of two circles, at most; both units may be tilted
        # A pair of units farther apart than this has no circles that near, whatever their headings.
        self._far_m = max(
            math.hypot(px, py) + math.hypot(bx, by) + pin + bottom + self._apart_m + _ROUNDING_M
            for (px, py, pin), (bx, by, bottom) in zip(self._pin_circles, self._bottom_circles, strict=True)
        )

    def left(self) -> tuple[float, ...]:
        """Return the distance of each pin from the bottom of its hole [m]; infinite beyond the reach."""
        if not self._near():
            return (math.inf,) * len(self.pins)
        X_WI = pybullet.getBasePositionAndOrientation(self._target.body, physicsClientId=self._world.client)
        return tuple(self._distance(X_WI, *pair) for pair in zip(self.pins, self._bottoms, strict=True))

    def _near(self) -> bool:
        """Return whether any pin may be in reach, by circles about pins and bottoms on the floor."""
        X_WU, X_WT = map(self._world.pose, self._names)
        dx, dy = X_WU.x - X_WT.x, X_WU.y - X_WT.y
        if math.hypot(dx, dy) > self._far_m:
            return False
        cu, su, ct, st = math.cos(X_WU.yaw), math.sin(X_WU.yaw), math.cos(X_WT.yaw), math.sin(X_WT.yaw)
        for (px, py, pin), (bx, by, bottom) in zip(self._pin_circles, self._bottom_circles, strict=True):
            apart = math.hypot(
                dx + cu * px - su * py - ct * bx + st * by, dy + su * px + cu * py - st * bx - ct * by
            )
            if apart <= pin + bottom + self._apart_m:
                return True
        return False

    def _pin(self, side: str) -> int:
        pin = f"pin_{side}"
        if pin not in self._unit.links:
            raise self._lacks(self._step.unit, self._unit, f"link {pin!r}", pin)
        return self._unit.link(pin)

    def _bottom(self, side: str) -> tuple[_Shape, ...]:
        """Return the shapes at the bottom of a hole."""
        hole = self._hole(side)
        solids = [solid for solid in self._target.geometry.solids if solid.link == hole]
        if not solids or any(solid.kind != "box" for solid in solids):
            raise self._lacks(self._step.target_unit, self._target, f"link {hole!r} made of boxes", hole)
        bottom = []
        for solid in solids:
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_BOX,
                halfExtents=[0.5 * edge for edge in solid.size],
                physicsClientId=self._world.client,
            )
            X_IG = self._target.X_IU @ solid.X_UG
            bottom.append((shape, (X_IG.p.tolist(), X_IG.quaternion_xyzw().tolist())))
        return tuple(bottom)

    def _hole(self, side: str) -> str:
        return f"port_{self._step.target_port}_hole_{side}"

    def _lacks(self, name: str, unit: UnitBody, part: str, frame: str) -> GeometryError:
        """Return the error for a part of a unit that the step cannot do without."""
        return GeometryError(
            f"units.{name}: {unit.geometry.urdf.name} has no {part}, and {self._step} by contact needs it. A "
            f"link of another name is mapped by units.{name}.frames: {{{frame}: <link>}}"
        )

    def _distance(self, X_WI: tuple[Any, Any], pin: int, bottom: tuple[_Shape, ...]) -> float:
        """Return the distance of a pin from a bottom [m]; ``X_WI`` is the inertial frame of the target."""
        client = self._world.client
        distance = math.inf
        for shape, X_IG in bottom:
            position, quaternion = pybullet.multiplyTransforms(*X_WI, *X_IG, physicsClientId=client)
            # The bottom is welded to the unit, so that the query places shapes of its own there.
            points = pybullet.getClosestPoints(
                self._unit.body,
                -1,
                self._reach_m,
                linkIndexA=pin,
                collisionShapeB=shape,
                collisionShapePositionB=position,
                collisionShapeOrientationB=quaternion,
                physicsClientId=client,
            )
            distance = min([distance, *(float(point[8]) for point in points)])
        return distance


def _circle(unit: UnitBody, link: str) -> tuple[float, float, float]:
    """Return middle x, y and radius [m] of a circle on the floor about the shapes of a link, in U."""
    outlines = [solid.outline() for solid in unit.geometry.solids if solid.link == link]
    if not outlines:
        return 0.0, 0.0, -math.inf  # nothing of it is ever in reach
    points = np.concatenate(outlines)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return float(middle[0]), float(middle[1]), float(np.linalg.norm(points - middle, axis=1).max())
