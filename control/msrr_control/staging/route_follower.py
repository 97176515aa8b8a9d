"""The follower of routes: it drives a unit along a route by a law, and says when another route is needed."""

from __future__ import annotations

import math
from typing import Generic

import numpy as np

from msrr_control.kinematics.controlled_point import offset_point
from msrr_control.path_following.law import PathFollowingLaw, State
from msrr_control.path_following.path import Path
from msrr_control.planning.route import ArenaMap, Route
from msrr_control.planning.route_monitor import RouteMonitor, as_obstacles
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.sequence.observation import Observation
from msrr_control.staging.parameters import WatchSpec
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import AssemblyPath, AssemblyProgress, Twist, seconds

#: Distance between the points of a path that are logged [m].
_LOGGED_SPACING_M = 0.05


class RouteFollower(Generic[State]):
    """Follows one route after the other, with the state of the law on the present one."""

    def __init__(self, law: PathFollowingLaw[State], planner: RoutePlanner, watch: WatchSpec) -> None:
        """Begin without a route."""
        self._law, self._planner, self._watch = law, planner, watch
        self._monitor: RouteMonitor | None = None
        self._state: State | None = None
        self._furthest = (0.0, 0)  # arc length that counts as progress, and the time at which it was reached
        self._avoiding: str | None = None
        self._cut: tuple[Path, float, Path] | None = None  # a path, a place on it, and the path up to there

    def set_route(self, route: Route, arena: ArenaMap) -> None:
        """Take up a route that was planned in ``arena``, without moving along it yet."""
        self._state = None
        self._monitor = RouteMonitor(route, self._planner, arena)

    def drop_route(self) -> None:
        """Give up the route."""
        self._monitor = self._state = None

    def clear_avoided(self) -> None:
        """Report no obstacle as being avoided until the next step."""
        self._avoiding = None

    @property
    def route(self) -> Route:
        """The route that was taken up last."""
        return self._monitored().route

    @property
    def started(self) -> bool:
        """Whether the law is at work on the route."""
        return self._state is not None

    @property
    def s(self) -> float:
        """Arc length of the desired point [m]; 0 before the law is at work."""
        return 0.0 if self._state is None else float(self._state.pace.s)

    @property
    def position(self) -> tuple[float, float]:
        """Point of the path at the arc length :attr:`s` in W [m]."""
        x, y, _, _ = self.route.path.components_at(np.asarray(self.s))
        return x, y

    def tip(self, X_WU: SE2) -> tuple[float, float]:
        """Return the controlled point in W [m]."""
        offset = self._planner.offset
        return X_WU.x + offset * math.cos(X_WU.yaw), X_WU.y + offset * math.sin(X_WU.yaw)

    def start(self, X_WU: SE2, twist: Twist, now_ns: int) -> None:
        """Start the law at the beginning of the path, with the controlled point l [m] ahead of the axle."""
        self._start_law(X_WU, twist, self._planner.offset)
        self._furthest = (0.0, now_ns)

    def restart(self, X_WU: SE2, twist: Twist, now_ns: int) -> None:
        """Start the law again where the unit is now, at the arc length that it has reached."""
        self._start_law(X_WU, twist, self.s)
        self._furthest = (self.s, now_ns)

    def hold(self, X_WU: SE2, twist: Twist, now_ns: int) -> None:
        """Let the law begin from rest where the unit is held: it must not go on without the unit.

        Time in which the unit is held is none in which it makes no progress.
        """
        self._start_law(X_WU, twist, self.s)
        self._furthest = (self._furthest[0], now_ns)

    def _start_law(self, X_WU: SE2, twist: Twist, s: float) -> None:
        self._state = self._law.start(X_WU.as_array(), np.array([twist.v, twist.w]), s)

    def step(self, arena: ArenaMap, s: float, dt: float, limit: float = math.inf) -> Twist:
        """Return the command of the law.

        The wall stands at arc length ``s``, and the unit has to come to rest at ``limit``, if the path is
        longer [m]. ``dt`` is the time by which the law goes on [s].

        Raises:
            RuntimeError: The law was not started on the route.
        """
        if self._state is None:
            raise RuntimeError("a step along a route on which the law was not started")
        monitor = self._monitored()
        pose = arena.X_WU.as_array()
        wall, self._avoiding = monitor.wall(arena, offset_point(pose, self._planner.offset), s)
        path, obstacles = monitor.route.path, as_obstacles(arena)
        if limit < float(path.length):
            path = self._until(path, max(limit, self.s))
        command, self._state = self._law.step(self._state, path, pose, wall, obstacles, dt)
        v, w = command.tolist()
        return Twist(v, w)

    def _until(self, path: Path, s: float) -> Path:
        """Return a path up to ``s`` [m]: the same one while the unit drives on to the same place."""
        if self._cut is None or self._cut[:2] != (path, s):
            self._cut = path, s, path.until(s)
        return self._cut[2]

    def time_without_progress(self, s: float, now_ns: int) -> float:
        """Return the time [s] since the unit, which is at ``s`` [m] now, last made enough progress."""
        if s > self._furthest[0] + self._watch.stuck_m:
            self._furthest = (s, now_ns)
        return seconds(now_ns - self._furthest[1])

    def distance_to_end(self, X_WU: SE2) -> float:
        """Return the distance of the controlled point from the end of the path [m]."""
        return _distance(self.tip(X_WU), self.route.path.at(math.inf).point)

    def reason_to_replan(self, arena: ArenaMap) -> str | None:
        """Return why another route is needed, None if none is."""
        monitor, watch = self._monitored(), self._watch
        moved, turned = monitor.end_moved(arena.X_WD)
        if moved > watch.target_moved_m or turned > math.radians(watch.target_moved_deg):
            turn = f"{math.degrees(turned):.1f} deg"
            return f"the place in front of the port is {moved:.3f} m elsewhere, and turned by {turn}"
        if self._state is not None:
            deviation = _distance(self.tip(arena.X_WU), self._state.guidance.position)
            if deviation > watch.astray_m:
                return f"{deviation:.2f} m off the path"
        return monitor.reason_to_replan(arena, self.s, watch.moved_m)

    def progress(
        self, observation: Observation, stage: str, path: AssemblyPath | None, reason: str
    ) -> AssemblyProgress | None:
        """Return the message for the log; None before the unit is localised.

        It says what the unit does and why, and which path is followed or was followed last.
        """
        if observation.arena is None:
            return None
        tip = self.tip(observation.arena.own.X_WB)
        desired = reference = tip
        if self._state is not None:
            desired, reference = _as_tuple(self._state.desired), _as_tuple(self._state.guidance.position)
        route = None if self._monitor is None else self._monitor.route
        return AssemblyProgress(
            stamp_ns=observation.now_ns,
            stage=stage,
            path=0 if path is None else path.number,
            tip=tip,
            desired=desired,
            reference=reference,
            s=self.s,
            arc_end=0.0 if route is None else float(route.path.arc_end),
            length=0.0 if route is None else float(route.path.length),
            avoiding=self._avoiding,
            reason=reason,
        )

    def _monitored(self) -> RouteMonitor:
        if self._monitor is None:
            raise RuntimeError("no route to follow was taken up")
        return self._monitor


def shown_path(stamp_ns: int, route: Route, before: AssemblyPath | None, reason: str) -> AssemblyPath:
    """Return the path of a route that is taken up at ``stamp_ns``, for the log, after the one ``before``."""
    _, points = route.path.sample(_LOGGED_SPACING_M)
    number = 1 if before is None else before.number + 1
    return AssemblyPath(stamp_ns, number, route.shape, tuple(_as_tuple(point) for point in points), reason)


def _as_tuple(point: Array) -> tuple[float, float]:
    x, y = point.tolist()
    return x, y


def _distance(tip: tuple[float, float], point: Array) -> float:
    x, y = point.tolist()
    return math.hypot(tip[0] - x, tip[1] - y)
