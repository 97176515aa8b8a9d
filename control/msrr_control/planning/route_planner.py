"""Chooses the path of the long-distance phase from what global localisation knows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import MappingProxyType

import numpy as np

from msrr_control.path_following.path import PaceSpec, Path
from msrr_control.path_following.walls import Encounter, PassageError, WallSpec, encounter
from msrr_control.planning.free_space import Disc, FreeSpace
from msrr_control.planning.route import Route, RouteSpec, Surroundings
from msrr_control.planning.tangents import Goal, shortest_way
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import ObstacleEstimate


class RoutePlanner:
    """Plans paths for one unit.

    The large arc of the paper is taken where it fits; walls (eq. 9) lead past obstacles on it. Where it does
    not fit, the way leads around everything, at last with a stop and a turn on the spot before the lead-in.
    """

    def __init__(
        self,
        spec: RouteSpec,
        walls: WallSpec,
        pace: PaceSpec,
        box: tuple[float, float, float, float],
        offset: float,
        body_half_width: float,
    ) -> None:
        """Bind the planner to what does not change.

        Args:
            spec: Shape of the paths.
            walls: When walls stand, and how far from obstacles.
            pace: Speed on the path.
            box: Arena: x low, x high, y low, y high [m].
            offset: l [m].
            body_half_width: Half the unit's width [m].
        """
        self.spec, self._walls, self._pace = spec, walls, pace
        x0, x1, y0, y1 = box
        b = spec.border_m
        self._box = (x0 + b, x1 - b, y0 + b, y1 - b)
        self._offset, self._half = offset, body_half_width

    def handover(self, X_WD: SE2) -> SE2:
        """Return where the path ends: the controlled point's place, and the heading."""
        return X_WD @ SE2(-self.spec.handover_m, 0.0, 0.0)

    def plan(self, around: Surroundings, caution: int = 0) -> Route | None:
        """Return the best route from where the unit stands, None if there is none.

        Args:
            around: What is known.
            caution: How often the unit was stopped on earlier routes. With any, obstacles are not left to
                walls, and each adds to the margin at which they are driven around.
        """
        if caution == 0:
            arc = next(self._arcs(around), None)
            if arc is not None:
                return arc
        margin = self.spec.around_margin_m * (1 + caution)
        ways = [*self._ways_around(around, margin), *self._staged(around, margin)]
        return min(ways, key=lambda r: r.seconds) if ways else None

    def unit_disc(self, disc: Disc) -> Disc:
        """Return the ground that the controlled point keeps out of because of another unit."""
        return disc._replace(radius=disc.radius + self._half + self.spec.unit_margin_m)

    def obstacle_disc(self, obstacle: ObstacleEstimate, margin: float = 0.0) -> Disc:
        """Return the ground that the controlled point keeps out of when it drives around an obstacle."""
        d = obstacle.radius + self._half + self._walls.margin_m + margin
        return Disc(obstacle.name, obstacle.X_WB.x, obstacle.X_WB.y, d)

    def pass_by(
        self,
        path: Path,
        obstacle: ObstacleEstimate,
        around: Surroundings,
        s: float,
        side: float | None = None,
    ) -> tuple[Encounter, float | None]:
        """Say how a path meets an obstacle, and on which side a wall could lead past it.

        Args:
            path: The path.
            obstacle: What stands near it.
            around: Everything else that is known.
            s: Arc length at which the unit is now [m].
            side: The only side that is considered; None for both.

        Returns:
            The encounter, and -1 right, +1 left, or None: there is nothing to pass, or no wall would do.
        """
        centre = obstacle.X_WB.translation
        half_width = obstacle.radius + self._half + self._walls.margin_m
        met = encounter(path, centre, np.asarray(half_width), self._walls)
        if not bool(met.blocked):
            return met, None
        try:
            self._walls.half_width(obstacle.radius, self._half)
        except PassageError:
            return met, None
        soon = float(met.s) - s < self.spec.least_run_m
        late = float(path.length) - float(met.s) < self._walls.before_end_m
        if soon or late:
            return met, None
        smaller = float(met.side)
        for chosen in (smaller, -smaller) if side is None else (side,):
            if self._has_room(met, chosen, centre, half_width, obstacle.name, around):
                return met, chosen
        return met, None

    def _has_room(
        self, met: Encounter, side: float, centre: Array, half_width: float, name: str, around: Surroundings
    ) -> bool:
        """Say whether the unit could drive along the wall on that side."""
        heading = float(met.heading)
        forward = np.array([math.cos(heading), math.sin(heading)])
        outward = side * np.array([-forward[1], forward[0]])
        along = np.linspace(-0.5 * self._walls.ahead_m, 2.0 * self._walls.past_m, 12)
        lane = centre + (half_width + 0.02) * outward + along[:, None] * forward
        others = [self.obstacle_disc(o) for o in around.obstacles if o.name != name]
        return self._ground(around, [*map(self.unit_disc, around.units), *others]).allows(lane)

    def _ground(self, around: Surroundings, discs: list[Disc]) -> FreeSpace:
        return FreeSpace(self._box, tuple(discs)).left_from(around.X_WU.x, around.X_WU.y)

    def _arcs(self, around: Surroundings) -> Iterator[Route]:
        """Yield routes of one circle and the lead-in, obstacles being left to walls."""
        ground = self._ground(around, [self.unit_disc(u) for u in around.units])
        for lead_in in self.spec.lead_in_m:
            path = self._arc(around, lead_in)
            if path is None or not ground.allows(path.sample(0.04)[1]):
                continue
            sides: dict[str, float] = {}
            stations: list[float] = []
            for obstacle in around.obstacles:
                met, side = self.pass_by(path, obstacle, around, self._offset)
                if not bool(met.blocked):
                    continue
                apart = min((abs(float(met.s) - s) for s in stations), default=math.inf)
                if side is None or apart < self._walls.ahead_m + self._walls.past_m:
                    break
                sides[obstacle.name] = side
                stations.append(float(met.s))
            else:
                yield self._route(path, "arc", sides, around)

    def _arc(self, around: Surroundings, lead_in: float) -> Path | None:
        """Return the circle from the axle that touches the docking axis where the lead-in begins."""
        X_WL = self.handover(around.X_WD) @ SE2(-lead_in, 0.0, 0.0)
        X_LU = X_WL.inverse() @ around.X_WU
        x, y = X_LU.x, X_LU.y
        square = x * x + y * y
        curvature = 2.0 * y / square if square > 0.0 else math.inf
        if abs(curvature) < 1e-3:
            if x > -self._offset:
                return None
            curvature, length = 0.0, -x
        else:
            radius = 1.0 / abs(curvature)
            sweep = math.atan2(-x, radius - abs(y)) % (2.0 * math.pi)
            if radius < self.spec.least_radius_m or sweep > math.radians(self.spec.most_sweep_deg):
                return None
            length = radius * sweep
        if length < self._offset:
            return None
        start = [around.X_WU.x, around.X_WU.y, X_WL.yaw - curvature * length]
        return Path(np.array(start), np.array([curvature, 0.0]), np.array([length, lead_in]))

    def _obstructed(self, around: Surroundings, margin: float) -> FreeSpace:
        units = [self.unit_disc(u) for u in around.units]
        return self._ground(around, units + [self.obstacle_disc(o, margin) for o in around.obstacles])

    def _ways_around(self, around: Surroundings, margin: float) -> Iterator[Route]:
        ground = self._obstructed(around, margin)
        end = self.handover(around.X_WD)
        for lead_in in self.spec.lead_in_m:
            X_WL = end @ SE2(-lead_in, 0.0, 0.0)
            for radius in self.spec.turn_radius_m:
                goal = Goal(X_WL.x, X_WL.y, X_WL.yaw, radius)
                way = shortest_way(ground, (around.X_WU.x, around.X_WU.y), goal)
                if way is None:
                    continue
                path = Path(way.start, np.append(way.curvature, 0.0), np.append(way.lengths, lead_in))
                if ground.allows(path.sample(0.04)[1]):
                    yield self._route(path, "around", {}, around)
                    break

    def _staged(self, around: Surroundings, margin: float) -> Iterator[Route]:
        """Yield routes to a place on the docking axis where the unit turns on the spot."""
        ground = self._obstructed(around, margin)
        end = self.handover(around.X_WD)
        for back in self.spec.stage_m:
            X_WP = end @ SE2(-back - self._offset, 0.0, 0.0)
            rest = np.linspace(X_WP.translation, end.translation, 40)
            if math.hypot(X_WP.x - around.X_WU.x, X_WP.y - around.X_WU.y) < 0.1 or not ground.allows(rest):
                continue
            way = shortest_way(ground, (around.X_WU.x, around.X_WU.y), Goal(X_WP.x, X_WP.y))
            if way is None:
                continue
            # The axle is to stop there, so the controlled point goes on by l.
            path = Path(way.start, np.append(way.curvature, 0.0), np.append(way.lengths, self._offset))
            if not ground.allows(path.sample(0.04)[1]):
                continue
            heading = float(path.at(path.length).heading)
            turn = abs(wrap_angle(X_WP.yaw - heading)) / self.spec.turn_radps
            yield self._route(path, "staged", {}, around, turn + self._travel(back))

    def _route(
        self, path: Path, shape: str, sides: dict[str, float], around: Surroundings, more: float = 0.0
    ) -> Route:
        turn = abs(wrap_angle(float(path.start[2]) - around.X_WU.yaw)) / self.spec.turn_radps
        time = turn + self._travel(float(path.length)) + 1.0 * len(sides) + more
        return Route(path, shape, MappingProxyType(sides), time)

    def _travel(self, length: float) -> float:
        """Return the time [s] for a path from rest to rest."""
        return length / self._pace.cruise_mps + self._pace.ramp_s


def blocking(around: Surroundings, planner: RoutePlanner) -> str:
    """Name what stands where the unit would have to be, for a message."""
    end = planner.handover(around.X_WD).translation[None]
    discs = [planner.unit_disc(u) for u in around.units]
    discs += [planner.obstacle_disc(o) for o in around.obstacles]
    hit = FreeSpace((-math.inf, math.inf, -math.inf, math.inf), tuple(discs)).hit(end)
    return "" if hit is None else f"; {hit.name} stands on the place in front of the port"
