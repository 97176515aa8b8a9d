"""Drawing of a mission: ways and routes of the units on the floor, docked pairs, and who waits for whom."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import meshcat.geometry as g
import numpy as np
from numpy.typing import NDArray

from msrr_bullet.timeline.palette import ALARM, BLACK, unit_colours
from msrr_bullet.timeline.routes import Routes, part_of
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.viewer import shapes
from msrr_bullet.viewer.commands import HIDDEN, Command, KeyframeTrack, NodeState, set_object, set_property
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import seconds
from msrr_scenes.messages.coordination import Authority
from msrr_scenes.specs.scene import Scene

#: Widths and heights above the floor of a driven way, of a route, and of the part of it that is granted [m].
WAY_WIDTH, WAY_Z = 0.016, 0.0032
ROUTE_WIDTH, ROUTE_Z = 0.006, 0.0026
GRANTED_WIDTH, GRANTED_Z, GRANTED_OPACITY = 0.06, 0.0015, 0.35
#: Smallest distance between two points of a driven way, and length of the pieces in which it appears [m].
WAY_STEP, WAY_PIECE = 0.01, 0.15
#: Smallest length of the pieces in which a granted part grows [m].
GRANTED_PIECE = 0.1
#: Size of the bar across a docked port, and its height above the solids of a unit [m].
JOINT_SIZE, JOINT_ABOVE = (0.02, 0.12, 0.006), 0.005
#: Height and width of the arrow from a unit that waits, its distance from either middle, and its head [m].
WAITS_Z, WAITS_WIDTH, WAITS_OFF, WAITS_HEAD = 0.21, 0.014, 0.07, 0.06


class MissionNodes:
    """Nodes of a mission. A scene without a base station has none."""

    def __init__(self, scene: Scene) -> None:
        """Read the units of the scene."""
        self._geometries = {unit: scene.geometry(unit) for unit in scene.units}
        self._colours = unit_colours(scene) if scene.coordinated else {}
        self._tops = {unit: _top(self._geometries[unit]) for unit in self._colours}
        self._routes = Routes(scene)
        self._drawn: dict[str, tuple[int, float]] = {}  # route and limit that the live view shows, by unit

    def build(self) -> Iterator[Command]:
        """Yield the commands that draw everything once that moves later."""
        head = [[0.0, 0.0], [-WAITS_HEAD, 0.4 * WAITS_HEAD], [-WAITS_HEAD, -0.4 * WAITS_HEAD]]
        for unit in self._colours:
            shaft = g.Box([1.0, WAITS_WIDTH, 0.004])
            yield set_object(f"waits/{unit}/shaft", shaft, shapes.flat_material(ALARM))
            yield set_object(f"waits/{unit}/head", shapes.extrusion(head, 0.004), shapes.flat_material(ALARM))
            yield set_object(f"joints/{unit}", g.Box(list(JOINT_SIZE)), shapes.flat_material(BLACK))
            for node in (f"waits/{unit}/shaft", f"waits/{unit}/head", f"joints/{unit}"):
                yield set_property(node, "visible", False)

    def node_states(self, snapshot: Snapshot) -> Iterator[tuple[str, NodeState]]:
        """Yield the state of every node. All snapshots of a scene have the same nodes."""
        for unit in self._colours:
            shaft = head = joint = HIDDEN
            mission = snapshot.mission
            other = None if mission is None else mission.waits_for(unit)
            if other is not None:
                shaft, head = _arrow(snapshot.units[unit], snapshot.units[other])
            port = None if mission is None else mission.docked_to(unit)
            if port is not None:
                holder, _, name = port.partition(".")
                X_WD = snapshot.units[holder] @ self._geometries[holder].dock_frame(name)
                joint = NodeState(SE3.from_se2(X_WD, self._tops[holder] + JOINT_ABOVE))
            yield f"waits/{unit}/shaft", shaft
            yield f"waits/{unit}/head", head
            yield f"joints/{unit}", joint

    # The live view.

    def live_routes(self, snapshot: Snapshot) -> Iterator[Command]:
        """Yield the commands that draw the routes which have changed since the last snapshot."""
        for unit in self._colours if snapshot.mission is not None else ():
            authority = None if snapshot.mission is None else snapshot.mission.granted(unit)
            shown = (0, 0.0) if authority is None else (authority.route, authority.limit)
            if shown == self._drawn.get(unit, (0, 0.0)):
                continue
            self._drawn[unit] = shown
            yield set_property(f"route/{unit}", "visible", authority is not None)
            if authority is not None:
                route = self._routes.of(authority)
                yield from self._line(f"route/{unit}/line", unit, part_of(route, 0.0, route.length))
                granted = part_of(route, 0.0, authority.limit)
                yield from self._granted(f"route/{unit}/granted", unit, granted)
                yield set_property(f"route/{unit}/granted", "visible", len(granted) > 1)

    def way(self, unit: str, piece: int, points: Sequence[Array]) -> Iterator[Command]:
        """Yield the command that draws a piece of the way that a unit has driven, through points (2,) [m]."""
        return shapes.flat_band(f"way/{unit}_{piece}", points, WAY_WIDTH, WAY_Z, self._colours[unit])

    # The replay.

    def replay(self, snapshots: Sequence[Snapshot]) -> tuple[list[Command], list[KeyframeTrack]]:
        """Return the commands that draw all ways and routes in pieces, and when each of them is shown."""
        commands: list[Command] = []
        tracks: list[KeyframeTrack] = []
        times = np.array([seconds(snapshot.stamp_ns) for snapshot in snapshots])

        def show(node: str, visible: NDArray[np.bool_]) -> None:
            commands.append(set_property(node, "visible", bool(visible[0])))
            tracks.append(KeyframeTrack(node, "visible", "bool", times, visible))

        for unit in self._colours:
            for k, (end, points) in enumerate(_pieces(snapshots, unit)):
                commands += self.way(unit, k, points)
                show(f"way/{unit}_{k}", np.arange(len(times)) >= end)
            for number, limits in _granted(snapshots, unit).items():
                node = f"route/{unit}_{number}"
                route = self._routes.of(limits[0][1])
                commands += self._line(f"{node}/line", unit, part_of(route, 0.0, route.length))
                shown = np.zeros(len(times), dtype=np.bool_)
                shown[[i for i, _ in limits]] = True
                show(node, shown)
                low, last = 0.0, max(authority.limit for _, authority in limits)
                for i, authority in limits:
                    high = authority.limit
                    if high - low >= GRANTED_PIECE or (high == last and high > low):
                        piece = f"{node}/{i}"
                        commands += self._granted(piece, unit, part_of(route, low, high))
                        show(piece, np.arange(len(times)) >= i)
                        low = high
        return commands, tracks

    def _line(self, node: str, unit: str, points: Array) -> Iterator[Command]:
        return shapes.flat_band(node, points, ROUTE_WIDTH, ROUTE_Z, self._colours[unit], 0.8)

    def _granted(self, node: str, unit: str, points: Array) -> Iterator[Command]:
        colour = self._colours[unit]
        return shapes.flat_band(node, points, GRANTED_WIDTH, GRANTED_Z, colour, GRANTED_OPACITY)


def _top(geometry: UnitGeometry) -> float:
    """Return the height of the solids of a unit above the floor [m]."""
    return max(float(solid.points()[:, 2].max()) for solid in geometry.solids)


def _arrow(start: SE2, end: SE2) -> tuple[NodeState, NodeState]:
    """Return the states of shaft and head of an arrow between the middles of two units."""
    yaw = math.atan2(end.y - start.y, end.x - start.x)
    length = max(math.hypot(end.x - start.x, end.y - start.y) - 2.0 * WAITS_OFF, WAITS_HEAD)
    X_WA = SE2(start.x, start.y, yaw) @ SE2(WAITS_OFF, 0.0, 0.0)
    middle, tip = X_WA @ SE2(0.5 * (length - WAITS_HEAD), 0.0, 0.0), X_WA @ SE2(length, 0.0, 0.0)
    shaft = NodeState(SE3.from_se2(middle, WAITS_Z), scale=(max(length - WAITS_HEAD, 1e-3), 1.0, 1.0))
    return shaft, NodeState(SE3.from_se2(tip, WAITS_Z))


def _pieces(snapshots: Sequence[Snapshot], unit: str) -> Iterator[tuple[int, list[Array]]]:
    """Yield the pieces of a driven way: index of the snapshot at its end, and its points (2,) in W [m]."""
    points, driven = [snapshots[0].units[unit].translation], 0.0
    for i, snapshot in enumerate(snapshots):
        point = snapshot.units[unit].translation
        step = float(np.linalg.norm(point - points[-1]))
        if step < WAY_STEP:
            continue
        points.append(point)
        driven += step
        if driven >= WAY_PIECE:
            yield i, points
            points, driven = [point], 0.0
    if len(points) > 1:
        yield len(snapshots) - 1, points


def _granted(snapshots: Sequence[Snapshot], unit: str) -> dict[int, list[tuple[int, Authority]]]:
    """Return by number of the route the snapshots in which it is driven, by index, with its authority."""
    routes: dict[int, list[tuple[int, Authority]]] = {}
    for i, snapshot in enumerate(snapshots):
        authority = None if snapshot.mission is None else snapshot.mission.granted(unit)
        if authority is not None:
            routes.setdefault(authority.route, []).append((i, authority))
    return routes
