"""Watches a route while it is driven: what stands beside it, which wall holds, whether it is still free."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from msrr_control.path_following.reference import SideWall
from msrr_control.path_following.tracking import Obstacles
from msrr_control.path_following.walls import Encounter, WallSpec, side_wall
from msrr_control.planning.free_space import Disc, FreeSpace
from msrr_control.planning.route import Route, Surroundings
from msrr_control.planning.route_planner import RoutePlanner
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import ObstacleEstimate

NO_WALL = SideWall(np.array(False), np.zeros(2), np.array(0.0))


class _Met(NamedTuple):
    """An obstacle beside the path: where it stood when that was found out, and how it is passed."""

    at: SE2
    encounter: Encounter
    side: float | None


class RouteMonitor:
    """What is known about one route while it is under way."""

    def __init__(
        self, route: Route, planner: RoutePlanner, around: Surroundings, walls: WallSpec, half_width: float
    ) -> None:
        """Begin with what the route was planned in.

        Args:
            route: The route.
            planner: Who planned it.
            around: What was known.
            walls: When walls stand.
            half_width: Half the unit's width [m].
        """
        self.route = route
        self._planner, self._walls, self._half = planner, walls, half_width
        self._end = planner.handover(around.X_WD)
        self._units = {unit.name: unit for unit in around.units}
        self._met: dict[str, _Met] = {}
        for obstacle in around.obstacles:
            met, side = planner.pass_by(
                route.path, obstacle, around, -math.inf, route.sides.get(obstacle.name)
            )
            self._met[obstacle.name] = _Met(obstacle.X_WB, met, side)

    def end_moved(self, X_WD: SE2) -> tuple[float, float]:
        """Return how far the place in front of the port has moved, in its estimate [m, rad]."""
        X = self._end.inverse() @ self._planner.handover(X_WD)
        return math.hypot(X.x, X.y), abs(wrap_angle(X.yaw))

    def trouble(self, around: Surroundings, s: float, moved: float) -> str | None:
        """Say why the route can no longer be followed, None if it can.

        Args:
            around: What is known now.
            s: Arc length that has been reached [m].
            moved: Motion of an estimate from which on it counts [m].
        """
        for obstacle in around.obstacles:
            reason = self._obstacle_trouble(obstacle, around, s, moved)
            if reason is not None:
                return reason
        for unit in around.units:
            before = self._units.get(unit.name)
            if before is not None and math.hypot(unit.x - before.x, unit.y - before.y) <= moved:
                continue
            self._units[unit.name] = unit
            if self._in_the_way(unit, around, s):
                return f"{unit.name} stands in the way now"
        return None

    def _obstacle_trouble(
        self, obstacle: ObstacleEstimate, around: Surroundings, s: float, moved: float
    ) -> str | None:
        at = obstacle.X_WB
        known = self._met.get(obstacle.name)
        if known is not None and math.hypot(at.x - known.at.x, at.y - known.at.y) <= moved:
            return None
        was_passed = known is not None and known.side is not None
        met, side = self._planner.pass_by(
            self.route.path, obstacle, around, s, known.side if known is not None else None
        )
        if was_passed and side is None and bool(met.blocked):
            # Too near to choose again: the wall that leads past it moves with the estimate.
            side = known.side if known is not None else None
        self._met[obstacle.name] = _Met(at, met, side)
        if side is not None or not bool(met.blocked) or float(met.s) < s - self._walls.past_m:
            return None
        where = f"{float(met.s) - s:.2f} m ahead"
        return f"{obstacle.name} {'appeared' if known is None else 'moved'} on the path, {where}"

    def _in_the_way(self, unit: Disc, around: Surroundings, s: float) -> bool:
        stations, points = self.route.path.sample(0.04)
        free = (-math.inf, math.inf, -math.inf, math.inf)
        ground = FreeSpace(free, (self._planner.unit_disc(unit),)).left_from(around.X_WU.x, around.X_WU.y)
        return ground.hit(points[stations >= s]) is not None

    def wall(self, around: Surroundings, tip: Array, s: float) -> tuple[SideWall, str | None]:
        """Return the one wall that stands now and whose it is: that of the first obstacle not yet passed."""
        standing: list[tuple[float, SideWall, str]] = []
        for obstacle in around.obstacles:
            known = self._met.get(obstacle.name)
            if known is None or known.side is None:
                continue
            if abs(float(known.encounter.s) - s) > 2.0 * self._walls.ahead_m:
                continue
            d = np.asarray(obstacle.radius + self._half + self._walls.margin_m)
            wall = side_wall(
                known.encounter, np.asarray(known.side), tip, obstacle.X_WB.translation, d, self._walls
            )
            if bool(wall.active):
                standing.append((float(known.encounter.s), wall, obstacle.name))
        if not standing:
            return NO_WALL, None
        _, first, name = min(standing, key=lambda item: item[0])
        return first, name


def as_obstacles(around: Surroundings) -> Obstacles:
    """Return what the springs push off from."""
    centre = np.array([(o.X_WB.x, o.X_WB.y) for o in around.obstacles]).reshape(-1, 2)
    return Obstacles(centre, np.ones(len(centre), dtype=bool))
