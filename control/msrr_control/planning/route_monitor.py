"""The monitor of a route under way: the wall that stands now, and whether the route is still free."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from msrr_control.path_following.obstacle_forces import Obstacles
from msrr_control.path_following.reference import SideWall
from msrr_control.path_following.walls import Encounter, side_wall
from msrr_control.planning.free_space import EVERYWHERE, Disc, FreeSpace
from msrr_control.planning.margins import SPACING_M
from msrr_control.planning.route import ArenaMap, Route
from msrr_control.planning.route_planner import RoutePlanner
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import ObstacleEstimate

NO_WALL = SideWall(np.array(False), np.zeros(2), np.array(0.0))

_NO_OBSTACLES = Obstacles(np.zeros((0, 2)), np.zeros(0, dtype=bool))


class _Passage(NamedTuple):
    """How the route passes an obstacle: the obstacle's pose at the time, the encounter, the wall's side."""

    X_WB: SE2
    encounter: Encounter
    side: float | None


class RouteMonitor:
    """Compares one route with what is known while the unit drives along it."""

    def __init__(self, route: Route, planner: RoutePlanner, arena: ArenaMap) -> None:
        """Begin with a route, its planner, and the map in which it was planned."""
        self.route, self._planner = route, planner
        self._end = planner.spec.handover(arena.X_WD)
        self._units = {unit.name: unit for unit in arena.units}
        self._passages: dict[str, _Passage] = {}
        for obstacle in arena.obstacles:
            encounter, side = planner.passing_side(
                route.path, obstacle, arena, -math.inf, route.sides.get(obstacle.name)
            )
            self._passages[obstacle.name] = _Passage(obstacle.X_WB, encounter, side)

    def end_moved(self, X_WD: SE2) -> tuple[float, float]:
        """Return how far the estimate of the place in front of the port has moved [m, rad]."""
        X = self._end.inverse() @ self._planner.spec.handover(X_WD)
        return math.hypot(X.x, X.y), abs(wrap_angle(X.yaw))

    def reason_to_replan(self, arena: ArenaMap, s: float, moved: float) -> str | None:
        """Return why the route can no longer be followed, None if it can.

        The unit has reached arc length ``s`` [m]. The motion of an estimate counts from ``moved`` [m] on.
        """
        for obstacle in arena.obstacles:
            reason = self._check_obstacle(obstacle, arena, s, moved)
            if reason is not None:
                return reason
        for unit in arena.units:
            known = self._units.get(unit.name)
            if known is not None and math.hypot(unit.x - known.x, unit.y - known.y) <= moved:
                continue
            self._units[unit.name] = unit
            if self._is_in_the_way(unit, arena, s):
                return f"{unit.name} stands in the way now"
        return None

    def _check_obstacle(
        self, obstacle: ObstacleEstimate, arena: ArenaMap, s: float, moved: float
    ) -> str | None:
        X_WB = obstacle.X_WB
        known = self._passages.get(obstacle.name)
        if known is not None and math.hypot(X_WB.x - known.X_WB.x, X_WB.y - known.X_WB.y) <= moved:
            return None
        known_side = known.side if known is not None else None
        encounter, side = self._planner.passing_side(self.route.path, obstacle, arena, s, known_side)
        if side is None and bool(encounter.blocked):
            side = known_side  # too near to choose again: the wall of the known side moves with the estimate
        self._passages[obstacle.name] = _Passage(X_WB, encounter, side)
        ahead = float(encounter.s) - s
        if (
            side is not None
            or not bool(encounter.blocked)
            or float(encounter.s) < s - self._planner.walls.release_m(self._planner.offset)
        ):
            return None
        return f"{obstacle.name} {'appeared' if known is None else 'moved'} on the path, {ahead:.2f} m ahead"

    def _is_in_the_way(self, unit: Disc, arena: ArenaMap, s: float) -> bool:
        """Return whether another unit stands on the rest of the path."""
        stations, points = self.route.path.sample(SPACING_M)
        space = FreeSpace(EVERYWHERE, (self._planner.margins.unit_disc(unit),))
        return space.opened_at(arena.X_WU.x, arena.X_WU.y).deepest_disc(points[stations >= s]) is not None

    def wall(self, arena: ArenaMap, tip: Array, s: float) -> tuple[SideWall, str | None]:
        """Return the one wall that stands now, that of the first obstacle not yet passed, and its name."""
        planner = self._planner
        standing: list[tuple[float, SideWall, str]] = []
        for obstacle in arena.obstacles:
            known = self._passages.get(obstacle.name)
            if known is None or known.side is None:
                continue
            if abs(float(known.encounter.s) - s) > 2.0 * planner.walls.ahead_m:
                continue
            wall = side_wall(
                known.encounter,
                np.asarray(known.side),
                tip,
                obstacle.X_WB.translation,
                np.asarray(planner.margins.obstacle_disc(obstacle).radius),
                planner.walls,
                planner.offset,
            )
            if bool(wall.active):
                standing.append((float(known.encounter.s), wall, obstacle.name))
        if not standing:
            return NO_WALL, None
        _, wall, name = min(standing, key=lambda item: item[0])
        return wall, name


def as_obstacles(arena: ArenaMap) -> Obstacles:
    """Return the obstacles of a map as arrays for a law."""
    if not arena.obstacles:
        return _NO_OBSTACLES
    centre = np.array([(o.X_WB.x, o.X_WB.y) for o in arena.obstacles])
    return Obstacles(centre, np.ones(len(centre), dtype=bool))
