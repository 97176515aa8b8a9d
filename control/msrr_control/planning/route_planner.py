"""The planner of routes: from where the unit stands to the place in front of the port."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from types import MappingProxyType

import numpy as np

from msrr_control.path_following.path import PaceSpec, Path
from msrr_control.path_following.walls import Encounter, WallSpec, find_encounter
from msrr_control.planning.free_space import Bounds, FreeSpace
from msrr_control.planning.margins import SPACING_M, Margins
from msrr_control.planning.route import ARENA_BORDER, ArenaMap, Route, RouteSpec
from msrr_control.planning.tangents import Goal, shortest_path
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import ObstacleEstimate

#: Curvature below which the circle to the docking axis is a line [1/m]; but for rounding, both end alike.
_LEAST_CURVATURE = 1e-9

#: Time that an obstacle on the path costs, beyond that of the way [s].
_PASSING_S = 1.0

#: Distance beyond a wall at which the way beside an obstacle has to be free [m].
_BESIDE_WALL_M = 0.02

#: Distance from a place to turn up to which a unit stands there already [m].
_THERE_M = 0.1

#: Directions of arrival, from that of the end, that are tried where the unit turns there and cannot come
#: straight [rad].
_ARRIVALS = tuple(0.25 * math.pi * k for k in range(8))

#: Number of points by which a line is checked for being free.
_POINTS = 40


class RoutePlanner:
    """Plans routes for one unit.

    The large arc of the paper is taken where it fits; walls (eq. 9) lead past obstacles on it. Where it does
    not fit, the path leads around everything, if necessary with a stop and a turn on the spot before the
    lead-in.

    Attributes:
        spec: Shape of the routes.
        walls: When walls stand, and how far from obstacles.
        offset: l [m].
        margins: How far the unit keeps from everything, by these.
    """

    def __init__(
        self,
        spec: RouteSpec,
        walls: WallSpec,
        pace: PaceSpec,
        box: Bounds,
        offset: float,
        body_half_width: float,
        border: str = ARENA_BORDER,
    ) -> None:
        """Bind the planner to what does not change.

        ``box`` are the bounds of the arena, x low, x high, y low, y high [m], and ``border`` is what they
        are, in words. The other arguments are the attributes, the speed along the path, and half the width of
        the unit's body [m].
        """
        self._border = border
        self.spec, self.walls, self._pace = spec, walls, pace
        self.offset = offset
        self.margins = Margins(spec, walls, box, offset, body_half_width)

    def plan(self, arena: ArenaMap, caution: int = 0) -> Route | None:
        """Return the best route from where the unit stands, None if there is none.

        Args:
            arena: What is known.
            caution: Number of times that the unit was stopped on earlier routes. From 1 on, obstacles are
                left to walls only where nothing else leads there, and each adds to the margin at which they
                are driven around.
        """
        if caution == 0:
            arc = next(self._arcs(arena, self.spec.lead_in_m), None)
            if arc is not None:
                return arc
        margin = self.spec.around_margin_m * caution
        routes = [*self._routes_around(arena, margin), *self._staged_routes(arena, margin)]
        if not routes:
            # Where a unit has turned near the border, the error of its stop may have used up the room.
            routes = [*self._arcs(arena, self.spec.short_lead_in_m)][:1]
        if routes:
            return min(routes, key=lambda r: r.seconds)
        return self._turned_route(arena, margin) if arena.turns_at_end else None

    def obstruction(self, arena: ArenaMap, end: str = "the place in front of the port") -> str:
        """Return what leaves no route to its end, which is given in words: border or body.

        It is the border if it alone leaves no route, else a body. Without that body there would be a route.
        If there is none such, it is the one deepest in the way.
        """
        X_WD = arena.X_WD
        target = tuple(u for u in arena.units if math.hypot(u.x - X_WD.x, u.y - X_WD.y) <= u.radius)
        if self.plan(arena._replace(units=target, obstacles=())) is None:
            return f"{self._border} leaves no room to turn before {end}"
        alone = [name for name, others in arena.without_one(target) if self.plan(others) is not None]
        space = self.margins.free_space(arena, map(self.margins.obstacle_disc, arena.obstacles))
        place = self.spec.handover(arena.X_WD).translation
        for points, where in (
            (place[None], f"on {end}"),
            (
                np.linspace(arena.X_WU.translation, place, _POINTS),
                f"between the unit and {end}, with too little room beside it or behind it",
            ),
        ):
            disc = space.deepest_disc(points)
            if disc is not None and (not alone or disc.name in alone):
                return f"{disc.name} stands {where}"
        if alone:
            return f"{alone[0]} stands in every way to {end}"
        return f"what stands in the arena leaves no room to turn before {end}"

    def passing_side(
        self,
        path: Path,
        obstacle: ObstacleEstimate,
        arena: ArenaMap,
        s: float,
        side: float | None = None,
    ) -> tuple[Encounter, float | None]:
        """Return how a path passes an obstacle, and on which side a wall can lead past it.

        Args:
            path: The path.
            obstacle: An obstacle near the path.
            arena: Everything else that is known.
            s: Arc length at which the unit is now [m].
            side: The only side that is considered; None for both.

        Returns:
            The encounter, and the side: -1 right, +1 left, None if the path is free or no wall is possible.
        """
        centre = obstacle.X_WB.translation
        half_width = self.margins.obstacle_disc(obstacle).radius
        encounter = find_encounter(path, centre, np.asarray(half_width), self.walls)
        if not bool(encounter.blocked):
            return encounter, None
        too_wide = half_width > self.walls.widest_m
        too_soon = float(encounter.s) - s < self.spec.least_run_m
        too_late = float(path.length) - float(encounter.s) < self.walls.before_end_m
        if too_wide or too_soon or too_late:
            return encounter, None
        nearer = float(encounter.side)
        for candidate in (nearer, -nearer) if side is None else (side,):
            if self._has_room(encounter, candidate, centre, half_width, obstacle.name, arena):
                return encounter, candidate
        return encounter, None

    def _has_room(
        self, encounter: Encounter, side: float, centre: Array, half_width: float, name: str, arena: ArenaMap
    ) -> bool:
        """Return whether the unit could drive along the wall on that side."""
        heading = float(encounter.heading)
        forward = np.array([math.cos(heading), math.sin(heading)])
        outward = side * np.array([-forward[1], forward[0]])
        along = np.linspace(-0.5 * self.walls.ahead_m, 2.0 * self.walls.release_m(self.offset), 12)
        lane = centre + (half_width + _BESIDE_WALL_M) * outward + along[:, None] * forward
        others = [self.margins.obstacle_disc(o) for o in arena.obstacles if o.name != name]
        return self.margins.free_space(arena, others).allows(lane)

    def _arcs(self, arena: ArenaMap, lead_ins: Iterable[float]) -> Iterator[Route]:
        """Yield routes of one circle and a lead-in, with obstacles left to walls."""
        space = self.margins.free_space(arena)
        for lead_in in lead_ins:
            path = self._arc_path(arena, lead_in)
            if path is None or not space.allows(path.sample(SPACING_M)[1]):
                continue
            sides: dict[str, float] = {}
            stations: list[float] = []
            for obstacle in arena.obstacles:
                encounter, side = self.passing_side(path, obstacle, arena, self.offset)
                if not bool(encounter.blocked):
                    continue
                distance = min((abs(float(encounter.s) - s) for s in stations), default=math.inf)
                if side is None or distance < self.walls.ahead_m + self.walls.release_m(self.offset):
                    break
                sides[obstacle.name] = side
                stations.append(float(encounter.s))
            else:
                yield self._route(path, "arc", arena, sides=sides)

    def _arc_path(self, arena: ArenaMap, lead_in: float) -> Path | None:
        """Return the circle from the axle that touches the docking axis where the lead-in begins."""
        X_WL = self.spec.handover(arena.X_WD) @ SE2(-lead_in, 0.0, 0.0)
        X_LU = X_WL.inverse() @ arena.X_WU
        x, y = X_LU.x, X_LU.y
        squared = x * x + y * y
        curvature = 2.0 * y / squared if squared > 0.0 else math.inf
        if abs(curvature) < _LEAST_CURVATURE:
            if x > -self.offset:
                return None
            curvature, length = 0.0, -x
        else:
            radius = 1.0 / abs(curvature)
            sweep = math.atan2(-x, radius - abs(y)) % (2.0 * math.pi)
            if radius < self.spec.least_radius_m or sweep > math.radians(self.spec.most_sweep_deg):
                return None
            length = radius * sweep
        if length < self.offset:
            return None
        start = [arena.X_WU.x, arena.X_WU.y, X_WL.yaw - curvature * length]
        return Path(np.array(start), np.array([curvature, 0.0]), np.array([length, lead_in]))

    def _routes_around(self, arena: ArenaMap, margin: float) -> Iterator[Route]:
        """Yield routes of lines and arcs around everything, one for each lead-in that allows one."""
        space = self.margins.free_space(arena, [self.margins.around_disc(o, margin) for o in arena.obstacles])
        end = self.spec.handover(arena.X_WD)
        for lead_in in self.spec.lead_in_m:
            X_WL = end @ SE2(-lead_in, 0.0, 0.0)
            for radius in self.spec.turn_radius_m:
                if radius <= self.offset:  # the axle cannot follow such an arc
                    continue
                path = self._path_around(space, arena, Goal(X_WL.x, X_WL.y, X_WL.yaw, radius), lead_in)
                if path is not None:
                    yield self._route(path, "around", arena)
                    break

    def _staged_routes(self, arena: ArenaMap, margin: float) -> Iterator[Route]:
        """Yield routes to a place on the docking axis where the unit turns on the spot."""
        space = self.margins.free_space(arena, [self.margins.around_disc(o, margin) for o in arena.obstacles])
        end = self.spec.handover(arena.X_WD)
        for distance in self.spec.stage_m:
            X_WP = end @ SE2(-distance - self.offset, 0.0, 0.0)
            remaining = np.linspace(X_WP.translation, end.translation, _POINTS)
            is_there = math.hypot(X_WP.x - arena.X_WU.x, X_WP.y - arena.X_WU.y) < _THERE_M
            if is_there or not space.allows(remaining):
                continue
            # The axle is to stop at P, so the path of the controlled point is longer by l.
            path = self._path_around(space, arena, Goal(X_WP.x, X_WP.y), self.offset)
            if path is None:
                continue
            heading = float(path.at(path.length).heading)
            turn = abs(wrap_angle(X_WP.yaw - heading)) / self.spec.turn_radps
            yield self._route(path, "staged", arena, seconds_after=turn + self._travel_time(distance))

    def _turned_route(self, arena: ArenaMap, margin: float) -> Route | None:
        """Return the best route to the end on any heading, for a unit that turns there; None without one.

        Where its controlled point keeps out of all discs on a way that stops there, the unit can turn. It
        comes straight if it can.
        """
        space = self.margins.free_space(arena, [self.margins.around_disc(o, margin) for o in arena.obstacles])
        X_WP, l = self.spec.handover(arena.X_WD) @ SE2(-self.offset, 0.0, 0.0), self.offset
        straight = self._path_around(space, arena, Goal(X_WP.x, X_WP.y), l)
        paths, radius = [straight], max(min(self.spec.turn_radius_m), 2.0 * l)
        for arrival in _ARRIVALS if straight is None else ():
            X_WB = X_WP @ SE2(0.0, 0.0, arrival) @ SE2(-l, 0.0, 0.0)  # l before the end: the axle trails
            paths.append(self._path_around(space, arena, Goal(X_WB.x, X_WB.y, X_WB.yaw, radius), 2.0 * l))
        routes = []
        for path in filter(None, paths):
            turn = abs(wrap_angle(X_WP.yaw - float(path.at(path.length).heading)))
            routes.append(self._route(path, "turned", arena, seconds_after=turn / self.spec.turn_radps))
        return min(routes, key=lambda route: route.seconds, default=None)

    def _path_around(self, space: FreeSpace, arena: ArenaMap, goal: Goal, straight: float) -> Path | None:
        """Return the shortest path to a goal and ``straight`` [m] beyond it, None if it is not free."""
        shortest = shortest_path(space, (arena.X_WU.x, arena.X_WU.y), goal)
        if shortest is None:
            return None
        path = Path(shortest.start, np.append(shortest.curvature, 0.0), np.append(shortest.lengths, straight))
        return path if space.allows(path.sample(SPACING_M)[1]) else None

    def _route(
        self,
        path: Path,
        shape: str,
        arena: ArenaMap,
        sides: dict[str, float] | None = None,
        seconds_after: float = 0.0,
    ) -> Route:
        """Return the route along a path, with ``seconds_after`` from the path's end to the port."""
        sides = sides or {}
        turn = abs(wrap_angle(float(path.start[2]) - arena.X_WU.yaw)) / self.spec.turn_radps
        seconds = turn + self._travel_time(float(path.length)) + _PASSING_S * len(sides) + seconds_after
        return Route(path, shape, MappingProxyType(sides), seconds)

    def _travel_time(self, length: float) -> float:
        """Return the time [s] for a path of that length [m] from rest to rest."""
        return length / self._pace.cruise_mps + self._pace.ramp_s
