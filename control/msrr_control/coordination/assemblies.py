"""Where units stand that are docked to each other, and where those will that are on the way to a port.

From above every unit is seen by itself, with an error of its own: that of its tag on its roof, and of the
image. In an assembly, pins and holes hold each unit within a millimetre of where its port puts it. So all
units of an assembly have one pose together, which is fitted to all that is seen of them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.shapes.bodies import SEATED, Body
from msrr_control.shapes.precedence import compose
from msrr_control.tracks.route_request import Standing
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import GlobalPose
from msrr_scenes.messages.coordination import UnitState

#: Distance and angle of a unit from where a dock puts it from which on it is not in that port [m], [rad]. It
#: may have left it unheard, or never have come there.
_APART_M, _APART_RAD = 0.1, 0.2

#: Distance between the bodies that stand for the rest of a way on which a unit may still drive [m].
_SPACING_M = 0.1

_ITERATIONS = 3


def locate(units: Mapping[str, UnitRecord], body: Body) -> None:
    """Set the poses of all docked units, and the ends of the routes into ports."""
    docks = {
        unit.name: unit.holder
        for unit in units.values()
        if unit.holder is not None and _is_held(unit, units[unit.holder[0]], unit.holder[1], body)
    }
    for assembly in _assemblies(docks, body):
        _fit(assembly, units)
    for unit in sorted(units.values(), key=lambda unit: unit.order):  # first those whose ports others enter
        unit.seat = None
        if not unit.under_way or unit.track is None or unit.enters is None:
            continue
        target = units[unit.enters[0]]
        if target.X_WU is not None:
            X_WE = body.docked(target.destination, unit.enters[1])
            unit.seat = X_WE if is_same_place(X_WE, unit.track.end) else None


def standing_bodies(unit: UnitRecord, units: Collection[UnitRecord]) -> list[Standing]:
    """Return the bodies of a unit for the planning of another one: at the end of its route, or where it is.

    One that may go on by itself is everywhere on the rest of its way, too.
    """
    if unit.under_way:
        return [Standing(unit.name, unit.destination, unit.enters is not None)]
    holds = any(unit.name == port[0] for other in units for port in other.docks)
    at_port = holds or bool(unit.docks) or unit.state is UnitState.DOCKED
    bodies = [Standing(unit.name, unit.pose, at_port)]
    if unit.may_go_on and unit.track is not None:
        rest = np.arange(unit.track.length, unit.passed, -_SPACING_M)
        bodies += [Standing(unit.name, unit.track.at(float(s)), at_port) for s in rest]
    return bodies


def is_same_place(X_WA: SE2, X_WB: SE2) -> bool:
    """Return whether a unit, or a route into a port, is where another estimate has the same port."""
    off = X_WA.inverse() @ X_WB
    return math.hypot(off.x, off.y) <= _APART_M and abs(wrap_angle(off.yaw)) <= _APART_RAD


def _is_held(unit: UnitRecord, holder: UnitRecord, port: str, body: Body) -> bool:
    """Return whether a unit that was locked to a port still stands there."""
    if unit.under_way or holder.under_way or unit.X_WU is None or holder.X_WU is None:
        return False
    return is_same_place(unit.pose, body.docked(holder.pose, port))


def _assemblies(docks: Mapping[str, tuple[str, str]], body: Body) -> Iterator[dict[str, SE2]]:
    """Yield for each assembly the pose of every unit in the first one."""
    left = dict(docks)
    while left:
        poses = {next(iter(left)): SE2()}
        grows = True
        while grows:
            grows = False
            for name, (holder, port) in tuple(left.items()):
                if holder in poses:
                    poses.setdefault(name, body.docked(poses[holder], port))
                elif name in poses:
                    poses[holder] = poses[name] @ body.docked(SE2(), port).inverse()
                else:
                    continue
                del left[name]
                grows = True
        yield poses


def _fit(assembly: Mapping[str, SE2], units: Mapping[str, UnitRecord]) -> None:
    """Set the poses of the units of an assembly to those that fit best to all that is seen of them."""
    X_WA = units[next(iter(assembly))].pose
    sights = {name: sight for name in assembly if (sight := units[name].sight) is not None}
    if sights:
        X_WA = _fitted(X_WA, [assembly[name] for name in sights], list(sights.values()))
    for name, X_AU in assembly.items():
        units[name].X_WU = X_WA @ X_AU


def _fitted(X_WA: SE2, places: Sequence[SE2], sights: Sequence[GlobalPose]) -> SE2:
    """Return the pose of the first unit of an assembly that fits best to what is seen of some of its units.

    It minimises the sum of squares, weighted by the covariance that each sight has against bodies near it and
    by the play of the ports, by Gauss-Newton. What all sights are off together, because they are of the same
    camera, stays.

    The search begins at ``X_WA``, some centimetres and degrees off at most. ``places`` has the pose of each
    unit in the first one, and ``sights`` what is seen of each.
    """
    placed = np.array([X_AU.as_array() for X_AU in places])
    seen = np.array([sight.X_WB.as_array() for sight in sights])
    weights = np.linalg.inv(np.array([sight.relative for sight in sights]) + SEATED)
    jacobians = np.tile(np.eye(3), (len(placed), 1, 1))
    for _ in range(_ITERATIONS):
        poses = compose(X_WA, placed)
        residuals = seen - poses
        residuals[:, 2] = np.remainder(residuals[:, 2] + math.pi, 2.0 * math.pi) - math.pi
        jacobians[:, 0, 2], jacobians[:, 1, 2] = X_WA.y - poses[:, 1], poses[:, 0] - X_WA.x
        weighted = jacobians.transpose(0, 2, 1) @ weights
        information = (weighted @ jacobians).sum(axis=0)
        gradient = (weighted @ residuals[:, :, None]).sum(axis=0)[:, 0]
        x, y, yaw = np.linalg.solve(information, gradient).tolist()
        X_WA = SE2(X_WA.x + x, X_WA.y + y, X_WA.yaw + yaw)
    return X_WA
