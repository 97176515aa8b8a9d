"""Checks of a port against the port that it docks to: it lies straight ahead, and the pins fit the holes."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msrr_scenes.checks.problems import KeyPath, Problem
from msrr_scenes.geometry.pin_and_hole import PinAndHole, bounds
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.specs.scene import Scene

#: Largest distance and angle of an active port from straight ahead. The robot steers the point ahead of the
#: middle of its axle to the port, so that it misses by as much.
_ASIDE_M, _TURNED_RAD = 1e-3, math.radians(0.5)

#: Largest distance of a pin to the side of its hole, beyond the play in the hole, and of its tip from the
#: bottom of the hole when the faces meet. Pins that are off alike take the robot aside; seat switches have
#: closed by then.
_OFF_M = 0.002

#: Rounding of what is drawn [m].
_DRAWN_M = 1e-5


def mechanism_problems(scene: Scene) -> Iterator[Problem]:
    """Yield active ports that are not straight ahead, and pins that do not fit the holes of a step."""
    for dock in scene.possible_docks:
        unit, port, target = dock.unit, dock.port, dock.target_unit
        mapped = f"port_{port}" in scene.units[unit].frames
        path: KeyPath = ("units", unit, "frames", f"port_{port}") if mapped else ("units", unit, "urdf")
        own = scene.geometry(unit)
        text = _aside(own, port)
        if text is None:
            holes = scene.geometry(target)
            if scene.plant == "bullet":
                text = _misfit(own, port, holes, dock.target_port, scene.judge.seated_depth_m)
            text = text or _narrow(own, port, holes, dock.target_port)
            text = text and f"to dock to {dock.to}: {text}"
        if text is not None:
            yield Problem(path, f"{own.urdf.name}: {text}")


def _aside(own: UnitGeometry, port: str) -> str | None:
    X_UP = own.port(port)
    if abs(X_UP.y) <= _ASIDE_M and abs(X_UP.yaw) <= _TURNED_RAD:
        return None
    return (
        f"port_{port} is {1e3 * abs(X_UP.y):.1f} mm beside the x axis of the frame axle and turned by "
        f"{math.degrees(X_UP.yaw):z.1f} deg; a robot docks with what is straight ahead of its axle"
    )


def _narrow(own: UnitGeometry, port: str, target: UnitGeometry, to: str) -> str | None:
    """Return where the holes are too narrow for the pins; None if nowhere, or if there are no pins."""
    if not own.pins:
        return None
    fit = PinAndHole.of(own, port, target, to)
    for where, room in (("mouths", fit.mouth), ("holes", fit.play)):
        if room <= 0.0:
            width = f"{-2e3 * room:.1f} mm too narrow for" if room < 0.0 else "no wider than"
            return (
                f"the {where} of port_{to} of {target.urdf.name} are {width} the pins, at their height. "
                "Collision shapes are convex: draw the walls around a hole one by one"
            )
    return None


def _misfit(own: UnitGeometry, port: str, target: UnitGeometry, to: str, deepest: float) -> str | None:
    """Return which pin does not fit its hole when the faces meet; None if all fit, or some are missing."""
    X_PU, X_DU = (SE3.from_se2(X).inverse() for X in (own.port(port), target.dock_frame(to)))
    offs, rooms = [], []
    for side in ("left", "right"):
        pin, hole = bounds(own, f"pin_{side}", X_PU), bounds(target, f"port_{to}_hole_{side}", X_DU)
        if pin is None or hole is None:
            return None
        room = 0.5 * abs((hole[1] - hole[0]) - (pin[1] - pin[0]))
        off = 0.5 * (pin[0] + pin[1] - hole[0] - hole[1])
        # A pin that is too high or too low meets the wall above or below the hole, whatever the robot does.
        for axis, most, ways in (
            (1, room[1] + _OFF_M, ("far to the left", "far to the right")),
            (2, room[2] + _DRAWN_M, ("high", "low")),
        ):
            if abs(off[axis]) > most:
                way = ways[int(off[axis] < 0.0)]
                return f"pin_{side} is {1e3 * abs(off[axis]):.1f} mm too {way} for its hole"
        short = float(hole[0, 0] - pin[1, 0])
        if not -deepest <= short <= _OFF_M:
            way = "short of" if short > 0.0 else "behind"
            return (
                f"pin_{side} ends {1e3 * abs(short):.1f} mm {way} the bottom of its hole when port_{port} "
                f"and port_{to} meet. They belong to the faces, and a pin is as long as its hole is deep"
            )
        offs.append(float(off[1]))
        rooms.append(float(room[1]))
    apart = offs[0] - offs[1]
    if abs(apart) > sum(rooms) + _DRAWN_M:  # one of them would have to be to the left, the other to the right
        way = "farther apart than" if apart > 0.0 else "nearer to each other than"
        return (
            f"pin_left and pin_right are {1e3 * abs(apart):.1f} mm {way} their holes, which leave "
            f"{1e3 * sum(rooms):.1f} mm"
        )
    return None
