"""Drives a unit along a route by a law of the long-distance phase, and says when it cannot be followed."""

from __future__ import annotations

import math
from typing import Generic, Protocol, TypeVar

import numpy as np

from msrr_control.kinematics.offset_point import offset_point
from msrr_control.path_following.law import PathFollowingLaw, PathFollowingState
from msrr_control.path_following.reference import ReferenceState
from msrr_control.planning.route import Route, Surroundings
from msrr_control.planning.route_monitor import RouteMonitor, as_obstacles
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import AssemblyProgress, Twist, seconds


class TrackedState(PathFollowingState, Protocol):
    """State of a law that tells what it lets the controlled point go to besides."""

    @property
    def guidance(self) -> ReferenceState:
        """The reference that is tracked."""
        ...


State = TypeVar("State", bound=TrackedState)


class RouteFollower(Generic[State]):
    """One route after the other, and the law's state on the present one."""

    def __init__(
        self,
        law: PathFollowingLaw[State],
        planner: RoutePlanner,
        params: AssemblyParams,
        setup: AssemblySetup,
    ) -> None:
        """Begin without a route."""
        self._law, self._planner, self._params, self._setup = law, planner, params, setup
        self._run: RouteMonitor | None = None
        self._state: State | None = None
        self._furthest = (0.0, 0)  # arc length that counts as progress, and when it was reached
        self._avoiding: str | None = None

    def take(self, route: Route, around: Surroundings) -> None:
        """Take up a route that was planned in these surroundings; the unit does not move along it yet."""
        self._state = None
        self._run = RouteMonitor(route, self._planner, around, self._params.walls, self._setup.half_width)

    def drop(self) -> None:
        """Give up the route."""
        self._run = self._state = None

    def forget_wall(self) -> None:
        """Say of no obstacle that it is being avoided, until the next step."""
        self._avoiding = None

    @property
    def route(self) -> Route:
        """The route under way."""
        return self._watched().route

    @property
    def moves(self) -> bool:
        """The law is at work on the route."""
        return self._state is not None

    @property
    def s(self) -> float:
        """Arc length of the desired point [m]; 0 before the law is at work."""
        return 0.0 if self._state is None else float(self._state.pace.s)

    def tip(self, X_WU: SE2) -> tuple[float, float]:
        """Return the controlled point in W [m]."""
        return _point(offset_point(X_WU.as_array(), self._setup.offset))

    def start(self, X_WU: SE2, twist: Twist, now_ns: int, s: float) -> None:
        """Let the law begin from where the unit is, ``s`` [m] into the path."""
        self._state = self._law.start(X_WU.as_array(), np.array([twist.v, twist.w]), s)
        self._furthest = (self.s, now_ns)

    def begin(self, X_WU: SE2, twist: Twist, now_ns: int) -> None:
        """Let the law begin at the start of the path, the controlled point being l [m] ahead of the axle."""
        self.start(X_WU, twist, now_ns, self._setup.offset)
        self._furthest = (0.0, now_ns)

    def step(self, around: Surroundings, s: float, dt: float) -> Twist:
        """Return the law's command; the wall is the one that stands at ``s`` [m]."""
        if self._state is None:
            raise RuntimeError("a step along a route that was not begun")
        run = self._watched()
        pose = around.X_WU.as_array()
        wall, self._avoiding = run.wall(around, offset_point(pose, self._setup.offset), s)
        command, self._state = self._law.step(
            self._state, run.route.path, pose, wall, as_obstacles(around), dt
        )
        v, w = command.tolist()
        return Twist(v, w)

    def without_progress(self, s: float, now_ns: int) -> float:
        """Return the time [s] since the unit last got on by as much as counts; it is at ``s`` [m] now."""
        if s > self._furthest[0] + self._params.watch.stuck_m:
            self._furthest = (s, now_ns)
        return seconds(now_ns - self._furthest[1])

    def from_end(self, X_WU: SE2) -> float:
        """Return the distance of the controlled point from the end of the path [m]."""
        return _apart(self.tip(X_WU), self.route.path.at(math.inf).point)

    def trouble(self, around: Surroundings) -> str | None:
        """Say why another path is needed, None if none is."""
        run, watch = self._watched(), self._params.watch
        moved, turned = run.end_moved(around.X_WD)
        if moved > watch.target_moved_m or turned > math.radians(watch.target_moved_deg):
            return f"the place in front of the port is {moved:.3f} m elsewhere"
        if self._state is not None:
            off = _apart(self.tip(around.X_WU), self._state.guidance.position)
            if off > watch.astray_m:
                return f"{off:.2f} m off the path"
        return run.trouble(around, self.s, watch.moved_m)

    def progress(self, X_WU: SE2, stamp_ns: int, stage: str, path: int, reason: str) -> AssemblyProgress:
        """Return what is going on, for the log: of the stage, and of the path of that number."""
        tip = self.tip(X_WU)
        desired = reference = tip
        if self._state is not None:
            desired, reference = _point(self._state.desired), _point(self._state.guidance.position)
        run = self._run
        return AssemblyProgress(
            stamp_ns=stamp_ns,
            stage=stage,
            path=path,
            tip=tip,
            desired=desired,
            reference=reference,
            s=self.s,
            arc_end=0.0 if run is None else float(run.route.path.arc_end),
            length=0.0 if run is None else float(run.route.path.length),
            avoiding=self._avoiding,
            reason=reason,
        )

    def _watched(self) -> RouteMonitor:
        if self._run is None:
            raise RuntimeError("nothing to follow: no route was taken up")
        return self._run


def _point(place: Array) -> tuple[float, float]:
    x, y = place.tolist()
    return x, y


def _apart(tip: tuple[float, float], place: Array) -> float:
    x, y = place.tolist()
    return math.hypot(tip[0] - x, tip[1] - y)
