"""Tracks for tasks: into a port, to a pose, or out of a port, by the planner of the long-distance phase."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import product, takewhile

import numpy as np

from msrr_control.path_following.path import Path
from msrr_control.planning.free_space import Bounds, Disc
from msrr_control.planning.lane import in_lane
from msrr_control.planning.route import ARENA_BORDER, ArenaMap
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.shapes.bodies import LOSS_M, Body
from msrr_control.shapes.hop_rules import LEAST_WAY_OUT_M
from msrr_control.shapes.precedence import Lanes, compose
from msrr_control.tracks.gaps import contact_on_the_way, first_contact, is_beside
from msrr_control.tracks.route_params import RouteParams
from msrr_control.tracks.route_request import RouteRequest
from msrr_control.tracks.track import SPACING_M, Track, TrackBuilder
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import LegKind

#: Distance of the axle from its goal up to which a unit that stands there only turns [m].
STANDS_THERE_M = 0.02

#: Distance of the axle from its goal up to which a straight way there is tried before a route is planned [m].
_SHORT_M = 0.3

#: Ways out of a port that are tried before a route is planned from there [m].
BACK_OUT_M = (LEAST_WAY_OUT_M, 0.45, 0.60)

#: Directions that are tried for a way back to the border, counted from that away from it [rad].
_INWARDS = (0.0, 0.25 * math.pi, -0.25 * math.pi)

#: Ways straight ahead that are tried, in the open, before a route is planned from there [m].
_AHEAD_M = (0.1, 0.2)

#: Gap to an obstacle beside the lane of a port below which a unit is recalled [m]: smaller than that of a new
#: route by the uncertainty of an obstacle's place, so that one beside it may be seen a little elsewhere.
_CLOSED_GAP_M = 0.02


class RouteFinder:
    """Plans tracks around what stands."""

    def __init__(
        self,
        body: Body,
        params: RouteParams,
        box: Bounds,
        border: str = ARENA_BORDER,
        inner: Bounds | None = None,
    ) -> None:
        """Bind the finder to what does not change.

        ``box`` is where units may be and are seen, x low, x high, y low, y high [m], and ``border`` what it
        is, in words. ``inner`` are bounds inside of it that routes and shapes do not leave if there is a way.
        """
        self.body, self.box, self._border = body, box, border
        self.inner = box if inner is None else inner
        self._inside = None if self.inner == box else RouteFinder(body, params, self.inner, border)
        self.spec, self._lanes = params.route, Lanes(body, params.route)
        self._planner = RoutePlanner(
            params.route, params.walls, params.pace, box, body.offset, body.half_width, border
        )

    @property
    def boxes(self) -> tuple[Bounds, ...]:
        """Bounds inside of which a shape may be built; the first ones where it can be."""
        return (self.box,) if self._inside is None else (self.inner, self.box)

    def find(self, request: RouteRequest) -> Track | None:
        """Return a track, None if there is none."""
        if self._closed_by(request) is not None:
            return None
        inside = None if self._inside is None else self._inside.find(request)
        return self._find(request) if inside is None else inside

    def _find(self, request: RouteRequest) -> Track | None:
        X_WU, X_WE, obstacles, leaves = request.X_WU, request.X_WE, request.obstacles, request.leaves
        if X_WE is not None and not request.dock and leaves is None:
            short = self._short_way(X_WE, request)
            if short is not None and self._begins_freely(short, request):
                return short
        tight: Track | None = None  # the collision monitor holds a unit that turns beside an obstacle
        meets = False  # whether a route that the planner found comes too near to a unit
        ways = BACK_OUT_M if leaves is not None else self._straight_first(request)
        for room, distance in product((0.0, self._corner_cut), ways):
            if room and not meets:
                break
            builder = TrackBuilder(X_WU, self.body.offset)
            if leaves is not None:
                if self.behind(X_WU, distance, obstacles) is not None:
                    continue
                builder.back(distance)
            elif distance > 0.0:
                builder.ahead(distance)
            elif distance < 0.0:
                builder.reverse(-distance)
            if X_WE is not None and not self._plan(builder, X_WE, replace(request, room=room)):
                continue
            track = builder.track()
            if contact_on_the_way(track, request, self.body) is not None:
                meets = X_WE is not None
                continue
            if leaves is not None or self._begins_freely(track, request):
                return track
            tight = tight or track
        return None if request.held else tight

    @property
    def _corner_cut(self) -> float:
        """How much nearer to a unit the axle comes than the controlled point that drives around it [m].

        The margin from units has no room for all of that, and most routes need none.
        """
        radius = self.body.radius + self.body.half_width + self.spec.unit_margin_m
        return math.hypot(radius, self.body.offset) - radius

    def _straight_first(self, request: RouteRequest) -> list[float]:
        """Return the straight ways that are tried before a route is planned: ahead > 0, back < 0 [m].

        The last ones lead to where there is room to turn, beside obstacles and beside units as well.
        """
        X_WU, obstacles = request.X_WU, request.obstacles
        ways = [0.0]
        may_drive = partial(self._planner.margins.may_drive_ahead, X_WU, obstacles)
        if any(is_beside(X_WU, other, self.body) for other in request.others):
            ways += takewhile(may_drive, _AHEAD_M)
        for discs in ((), self._discs(request)):
            way = self._way_to_turn(X_WU, discs, request)
            if way is not None and way not in ways and (way < 0.0 or not discs or may_drive(way)):
                ways.append(way)
        return ways

    def _begins_freely(self, track: Track, request: RouteRequest) -> bool:
        """Return whether no turn on the spot at the start brings the unit too near to what stands there."""
        turns = [leg for leg in track.legs[:2] if leg.kind is LegKind.TURN]
        if not turns:
            return True
        if request.held:
            return self._way_to_turn(SE2(*turns[0].start), self._discs(request), request) == 0.0
        poses = track.poses[track.s <= turns[0].end]
        return not any(self.body.comes_near(poses, obstacle) for obstacle in request.obstacles)

    def _way_to_turn(self, X_WU: SE2, units: tuple[Disc, ...], request: RouteRequest) -> float | None:
        """Return the shortest way straight to where a unit can turn among units and all obstacles [m]."""
        arena = ArenaMap(X_WU, X_WU, units, request.obstacles)
        return self._planner.margins.way_to_turn(arena, self.body.radius)

    def behind(self, X_WU: SE2, distance: float, obstacles: tuple[ObstacleEstimate, ...]) -> str | None:
        """Return what keeps a unit from driving straight back by ``distance`` [m]; None if nothing does."""
        back = np.linspace(0.0, distance, 2 + math.ceil(distance / SPACING_M))
        poses = compose(X_WU, np.stack([-back, np.zeros_like(back), np.zeros_like(back)], axis=-1))
        x0, x1, y0, y1 = self.box
        x, y = poses[:, 0], poses[:, 1]
        outside = np.max([x0 - x, x - x1, y0 - y, y - y1], axis=0)
        if outside.max() > max(float(outside[0]), 0.0) + LOSS_M:
            return f"{self._border} is behind it"
        near = (o.name for o in obstacles if self.body.comes_near(poses, o))
        return next((f"{name} stands behind it" for name in near), None)

    def obstruction(self, request: RouteRequest) -> str | None:
        """Return in words what most probably leaves no track; None if there is one.

        The words go on from the name of the unit.
        """
        if self.find(request) is not None:
            return None
        in_lane = self._closed_by(request)
        if in_lane is not None:
            return f"cannot dock: {in_lane} stands in the lane to the port"
        X_WU, leaves = request.X_WU, request.leaves
        builder = TrackBuilder(X_WU, self.body.offset)
        if leaves is not None:
            behind = self.behind(X_WU, BACK_OUT_M[0], request.obstacles)
            if behind is not None:
                return f"cannot leave its port at {leaves}: {behind}"
            builder.back(BACK_OUT_M[0])
        if request.X_WE is not None and not self._plan(builder, request.X_WE, request):
            end = "the place in front of the port" if request.dock else "the end of its way"
            arena = self._arena(builder, request.X_WE, request)
            return f"finds no route: {self._planner.obstruction(arena, end)}"
        contact = contact_on_the_way(builder.track(), request, self.body)
        return "finds no route" if contact is None else f"finds no route past {contact[1]}"

    def _closed_by(self, request: RouteRequest) -> str | None:
        """Return the obstacle in the lane of the port at which a track is to end, None if there is none."""
        if not request.dock or request.X_WE is None:
            return None
        return self._lanes.obstacle_in(request.X_WE, request.obstacles)

    def ahead_in_lane(
        self, track: Track, progress: float, obstacles: tuple[ObstacleEstimate, ...]
    ) -> str | None:
        """Return the obstacle, as seen now, that a unit would meet on the rest of its dock leg; None if none.

        The track ends in a port, and the unit has covered it up to arc length ``progress`` [m].
        """
        X_WD = track.end @ SE2(self.body.offset, 0.0, 0.0)
        left = track.length - max(progress, track.dock_start)
        return in_lane(X_WD, left, self.body.half_width, obstacles, _CLOSED_GAP_M)

    def _short_way(self, X_WE: SE2, request: RouteRequest) -> Track | None:
        """Return a way straight ahead or back between two turns on the spot, to an end that is near.

        To such an end the planner, which leads the controlled point ahead of the axle, finds loops of metres.
        Where the unit stands there already, it only turns. None if the end is farther, or there is no room.
        """
        X_WU = request.X_WU
        dx, dy = X_WE.x - X_WU.x, X_WE.y - X_WU.y
        distance = math.hypot(dx, dy)
        if distance > _SHORT_M:
            return None
        if distance <= STANDS_THERE_M:
            builder = TrackBuilder(X_WU, self.body.offset)
            builder.turn_to(X_WE.yaw)
            track = builder.track()
            return track if first_contact(track, request.standing, self.body) is None else None
        tracks = [self._straight(yaw, distance, X_WE, request) for yaw in (0.0, math.pi)]
        found = [track for track in tracks if track is not None]
        return min(found, key=lambda track: track.length, default=None)

    def _straight(self, turned: float, distance: float, X_WE: SE2, request: RouteRequest) -> Track | None:
        """Return a straight way to an end nearby, back where the unit is ``turned`` by half a turn [rad]."""
        X_WU, builder = request.X_WU, TrackBuilder(request.X_WU, self.body.offset)
        builder.turn_to(math.atan2(X_WE.y - X_WU.y, X_WE.x - X_WU.x) + turned)
        if turned:
            free = self.behind(builder.pose, distance, request.obstacles) is None
            builder.reverse(distance)
        else:
            free = self._planner.margins.may_drive_ahead(builder.pose, request.obstacles, distance)
            builder.ahead(distance)
        builder.turn_to(X_WE.yaw)
        track = builder.track()
        meets = any(self.body.comes_near(track.poses, obstacle) for obstacle in request.obstacles)
        return track if free and not meets and contact_on_the_way(track, request, self.body) is None else None

    def _plan(self, builder: TrackBuilder, X_WE: SE2, request: RouteRequest) -> bool:
        """Append the route from where the builder stands; return whether there is one."""
        found = self._forwards(builder, X_WE, request)
        return found or (not request.dock and self._back_in(builder, X_WE, request))

    def _back_in(self, builder: TrackBuilder, X_WE: SE2, request: RouteRequest) -> bool:
        """Append a route to the border whose last part leads straight back; return whether there is one.

        In a corner the border leaves no room for the controlled point of a unit that comes forwards.
        """
        inwards = self._planner.margins.inwards(X_WE)
        if inwards is None:
            return False
        for distance, yaw in product(BACK_OUT_M, _INWARDS):
            X_WA = SE2(X_WE.x, X_WE.y, inwards + yaw) @ SE2(distance, 0.0, 0.0)
            behind = self.behind(X_WA, distance, request.obstacles)
            if behind is None and self._forwards(builder, X_WA, request):
                builder.reverse(distance)
                builder.turn_to(X_WE.yaw)
                return True
        return False

    def _forwards(self, builder: TrackBuilder, X_WE: SE2, request: RouteRequest) -> bool:
        """Append the route forwards from where the builder stands; return whether there is one."""
        arena = self._arena(builder, X_WE, request)
        route = self._planner.plan(arena)
        if route is not None and route.sides:
            # A wall leads off the path by an amount that is not known before: drive around instead.
            route = self._planner.plan(arena, caution=1)
        if route is None:
            return False
        builder.turn_to(float(route.path.start[2]))
        builder.follow(route.path)
        if not route.final:
            axle, end = builder.pose, self.spec.handover(arena.X_WD)
            dx, dy = end.x - axle.x, end.y - axle.y
            yaw = math.atan2(dy, dx)
            builder.turn_to(yaw)
            start = np.array([axle.x, axle.y, yaw])
            builder.follow(Path(start, np.zeros(1), np.array([math.hypot(dx, dy)])))
        if request.dock:
            builder.dock(X_WE, self.spec.handover_m)
        else:
            builder.turn_to(X_WE.yaw)
        return True

    def _arena(self, builder: TrackBuilder, X_WE: SE2, request: RouteRequest) -> ArenaMap:
        """Return what the planner is told of a route from where the builder stands."""
        X_WD = X_WE @ SE2(self.body.offset + (0.0 if request.dock else self.spec.handover_m), 0.0, 0.0)
        return ArenaMap(builder.pose, X_WD, self._discs(request), request.obstacles, not request.dock)

    def _discs(self, request: RouteRequest) -> tuple[Disc, ...]:
        """Return the circles about the units that stand there."""
        radius = self.body.radius + request.room
        return tuple(Disc(s.name, s.X_WB.x, s.X_WB.y, radius) for s in request.standing)
