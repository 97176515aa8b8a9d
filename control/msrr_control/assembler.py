"""The long-distance phase: from anywhere in the arena to the place in front of the port.

::

    LOCALISE -> PLAN -> TURN -> DRIVE -> SETTLE -> (hand-over)
                 ^                |        |
                 |                v        |
                 +-------------- BRAKE <---+  (stopped, something new on the path, a stage reached, not there)

The unit knows what global localisation tells it and nothing else. Each stage is one method: it returns a
twist to stay, a :class:`_Move` to another stage, or why the unit gives up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_control.assembly_setup import AssemblySetup
from msrr_control.assembly_tuning import AssemblyParams
from msrr_control.ground import Disc
from msrr_control.long_range import LongRangeLaw, LongRangeState
from msrr_control.offset_point import offset_point
from msrr_control.params import read_params
from msrr_control.route import RoutePlanner, Surroundings, blocking
from msrr_control.route_watch import RouteWatch, as_obstacles
from msrr_control.senses import Assembler, GiveUp, Senses
from msrr_scenes.errors import SceneError
from msrr_scenes.messages import AssemblyPath, AssemblyProgress, Setback, Situation, Twist, seconds
from msrr_scenes.registry import build
from msrr_scenes.se2 import SE2, wrap_angle
from msrr_scenes.spec import Choice

Array = NDArray[np.float64]

_STILL = Twist()

#: At less than this the unit stands [m/s], [rad/s]; longer than this it is not waited for [s].
_STANDS_MPS, _STANDS_RADPS, _BRAKE_S = 0.02, 0.08, 1.5

#: Longest turn on the spot [s].
_TURN_S = 10.0


class Stage(Enum):
    """What the unit does in the long-distance phase."""

    LOCALISE = "localise"
    BRAKE = "brake"
    PLAN = "plan"
    TURN = "turn"
    DRIVE = "drive"
    SETTLE = "settle"


class _Move(NamedTuple):
    """A change of stage and why; to None when the unit is there."""

    to: Stage | None
    reason: str


class LongRangeAssembler:
    """Leads the unit in front of the port by the paper's long-distance law.

    Attributes:
        progress: What it did at the last instant, None before the first.
        path: The path it follows or followed last, None before the first.
    """

    def __init__(self, params: AssemblyParams, setup: AssemblySetup) -> None:
        """Begin before anything is known.

        Raises:
            SceneError: What is asked cannot work wherever things stand.
        """
        setup.check(params.pace.cruise_mps, params.widest_obstacle_m, params.route.border_m)
        self.params, self._setup, self._watch = params, setup, params.watch
        self._law = LongRangeLaw(params, setup.limits, setup.offset)
        self._planner = RoutePlanner(
            params.route, params.walls, params.pace, setup.box, setup.offset, setup.half_width
        )
        self.progress: AssemblyProgress | None = None
        self.path: AssemblyPath | None = None
        self._stages = {
            Stage.LOCALISE: self._localise,
            Stage.BRAKE: self._brake,
            Stage.PLAN: self._plan,
            Stage.TURN: self._turn,
            Stage.DRIVE: self._drive,
            Stage.SETTLE: self._settle,
        }
        self._stage, self._reason = Stage.LOCALISE, "start"
        self._since_ns: int | None = None  # when the stage was entered
        self._then_ns: int | None = None
        self._unseen_ns: int | None = None
        self._looked_ns: int | None = None
        self._dt = 1.0 / setup.rate_hz
        self._run: RouteWatch | None = None
        self._state: LongRangeState | None = None
        self._furthest = (0.0, 0)  # arc length that counts as progress, and when it was reached
        self._paths, self._caution, self._came_back = 0, 0, False
        self._avoiding: str | None = None

    @property
    def stage(self) -> Stage:
        """What the unit does."""
        return self._stage

    def reset(self, reason: str) -> None:
        """Begin again from wherever the unit stands: the hand-over failed there."""
        self._paths, self._caution, self._came_back = 0, 0, True
        self._unseen_ns = self._then_ns = None
        self._change(_Move(Stage.LOCALISE, reason))

    def step(self, senses: Senses) -> Twist | GiveUp | None:
        """Return the command, None once the unit stands where the hand-over can begin, or why it gives up."""
        now = senses.now_ns
        if self._then_ns is not None and now > self._then_ns:
            self._dt = seconds(now - self._then_ns)
        self._then_ns = now
        decision = self._decide(senses)
        self._report(senses)
        return decision

    def _decide(self, senses: Senses) -> Twist | GiveUp | None:
        situation, now = senses.situation, senses.now_ns
        if situation is None or seconds(now - situation.last_seen_ns) > self._watch.stale_s:
            return self._wait_to_be_seen(now)
        if self._unseen_ns is not None:  # seen again: the law begins anew where the unit is now
            self._unseen_ns, self._state = None, self._restarted(senses, situation)
        around = self._surroundings(situation)
        for _ in range(2 * len(Stage)):  # a stage that has nothing to do is passed in the same instant
            if self._since_ns is None:
                self._since_ns = now
            decision = self._stages[self._stage](senses, around)
            if not isinstance(decision, _Move):
                return decision
            if decision.to is None:
                self._reason = decision.reason
                return None
            self._change(decision)
        return _STILL

    # The stages, in the order in which they come.

    def _wait_to_be_seen(self, now: int) -> Twist | GiveUp:
        """Stand while nobody knows where the unit is; show another side at the start."""
        if self._unseen_ns is None:
            self._unseen_ns = now
        waited = seconds(now - self._unseen_ns)
        if waited > self._watch.lost_s:
            return GiveUp(Setback.NOT_LOCALISED, f"not localised for {waited:.1f} s")
        turns = self._stage is Stage.LOCALISE and waited > self._watch.spin_after_s
        return Twist(0.0, self._watch.spin_radps) if turns else _STILL

    def _localise(self, senses: Senses, around: Surroundings) -> Twist | GiveUp | _Move:
        """Passed as soon as unit and target are known; so is the rest if the unit stands there already."""
        if not self._came_back and self._is_there(around):
            return _Move(None, "stands in front of the port")
        return _Move(Stage.BRAKE, f"localised: {self._reason}")

    def _brake(self, senses: Senses, around: Surroundings) -> Twist | GiveUp | _Move:
        """Come to rest."""
        v, w = abs(senses.twist.v), abs(senses.twist.w)
        if (v < _STANDS_MPS and w < _STANDS_RADPS) or self._lasted(senses.now_ns) > _BRAKE_S:
            return _Move(Stage.PLAN, self._reason)
        return _STILL

    def _plan(self, senses: Senses, around: Surroundings) -> Twist | GiveUp | _Move:
        """Choose a path; wait for one if there is none."""
        watch, now = self._watch, senses.now_ns
        if self._paths >= watch.paths:
            return GiveUp(Setback.BLOCKED, f"not there after {self._paths} paths: {self._reason}")
        if self._looked_ns is not None and seconds(now - self._looked_ns) < watch.retry_s:
            return _STILL
        self._looked_ns = now
        route = self._planner.plan(around, self._caution)
        if route is None:
            waited = self._lasted(now)
            if waited < watch.patience_s:
                return _STILL
            where = blocking(around, self._planner)
            return GiveUp(Setback.BLOCKED, f"no way to the port in {waited:.1f} s{where}; {self._reason}")
        self._paths += 1
        self._run = RouteWatch(route, self._planner, around, self.params.walls, self._setup.half_width)
        _, points = route.path.sample(0.05)
        number = 1 if self.path is None else self.path.number + 1
        shown = tuple((float(x), float(y)) for x, y in points)
        self.path = AssemblyPath(now, number, route.shape, shown, self._reason)
        return _Move(Stage.TURN, f"{route.shape} of {float(route.path.length):.2f} m: {self._reason}")

    def _turn(self, senses: Senses, around: Surroundings) -> Twist | GiveUp | _Move:
        """Turn on the spot to where the path begins."""
        run, watch = self._under_way(), self._watch
        trouble = self._trouble(run, around, 0.0)
        if trouble is not None:
            return _Move(Stage.BRAKE, trouble)
        off = wrap_angle(float(run.route.path.start[2]) - around.X_WU.yaw)
        began = self._lasted(senses.now_ns) > 0.0
        if abs(off) <= (watch.aligned if began else watch.askew) and abs(senses.twist.w) < 0.15:
            return _Move(Stage.DRIVE, self._reason)
        if self._lasted(senses.now_ns) > _TURN_S:
            self._caution += 1
            return _Move(Stage.BRAKE, "could not turn on the spot")
        most = min(0.7 * self._setup.limits.w_max_radps, 1.0)
        return Twist(0.0, min(max(self.params.turn_per_s * off, -most), most))

    def _drive(self, senses: Senses, around: Surroundings) -> Twist | GiveUp | _Move:
        """Follow the path."""
        run, watch, now = self._under_way(), self._watch, senses.now_ns
        pose = around.X_WU.as_array()
        if self._state is None:
            twist = np.array([senses.twist.v, senses.twist.w])
            self._state = self._law.start(pose, twist, self._setup.offset)
            self._furthest = (0.0, now)
        s = float(self._state.pace.s)
        trouble = self._trouble(run, around, s)
        if trouble is not None:
            return _Move(Stage.BRAKE, trouble)
        tip = offset_point(pose, self._setup.offset)
        wall, self._avoiding = run.wall(around, tip, s)
        command, self._state = self._law.step(
            self._state, run.route.path, pose, wall, as_obstacles(around), self._dt
        )
        if s > self._furthest[0] + watch.stuck_m:
            self._furthest = (s, now)
        left = float(run.route.path.length) - s
        if left < 2e-3:
            return _Move(Stage.SETTLE, self._reason)
        if seconds(now - self._furthest[1]) > watch.stuck_s:
            self._caution += 1
            return _Move(Stage.BRAKE, f"no progress for {watch.stuck_s:.1f} s, {left:.2f} m before the end")
        return Twist(float(command[0]), float(command[1]))

    def _settle(self, senses: Senses, around: Surroundings) -> Twist | GiveUp | _Move:
        """Come to rest at the end of the path, and say whether that is the place."""
        run = self._under_way()
        pose = around.X_WU.as_array()
        if self._state is not None:
            off = _apart(self._tip(around.X_WU), run.route.path.at(math.inf).point)
            rests = abs(senses.twist.v) < _STANDS_MPS and off < 0.5 * self._watch.there_m
            if not rests and self._lasted(senses.now_ns) < self._watch.settle_s:
                wall, self._avoiding = run.wall(around, offset_point(pose, self._setup.offset), math.inf)
                command, self._state = self._law.step(
                    self._state, run.route.path, pose, wall, as_obstacles(around), self._dt
                )
                return Twist(float(command[0]), float(command[1]))
        if not run.route.final:
            return _Move(Stage.BRAKE, "turn on the spot before the port")
        if self._is_there(around):
            return _Move(None, "in front of the port")
        return _Move(Stage.BRAKE, "not where the path should end")

    # What they share.

    def _trouble(self, run: RouteWatch, around: Surroundings, s: float) -> str | None:
        """Say why another path is needed, None if none is."""
        watch = self._watch
        moved, turned = run.end_moved(around.X_WD)
        if moved > watch.target_moved_m or turned > math.radians(watch.target_moved_deg):
            return f"the place in front of the port is {moved:.3f} m elsewhere"
        if self._state is not None:
            off = _apart(self._tip(around.X_WU), self._state.guidance.position)
            if off > watch.astray_m:
                return f"{off:.2f} m off the path"
        return run.trouble(around, s, watch.moved_m)

    def _is_there(self, around: Surroundings) -> bool:
        x, y = self._tip(around.X_WU)
        end = self._planner.handover(around.X_WD)
        near = math.hypot(x - end.x, y - end.y) <= self._watch.there_m
        return near and abs(wrap_angle(around.X_WU.yaw - end.yaw)) <= math.radians(self._watch.there_deg)

    def _tip(self, X_WU: SE2) -> tuple[float, float]:
        """Return the controlled point in W [m]."""
        return _point(offset_point(X_WU.as_array(), self._setup.offset))

    def _under_way(self) -> RouteWatch:
        if self._run is None:
            raise RuntimeError(f"stage {self._stage.value} without a path")
        return self._run

    def _restarted(self, senses: Senses, situation: Situation) -> LongRangeState | None:
        """Return the law's state begun anew on the way, None if it is not on its way."""
        if self._state is None:
            return None
        twist = np.array([senses.twist.v, senses.twist.w])
        s = float(self._state.pace.s)
        self._furthest = (s, senses.now_ns)
        return self._law.start(situation.own.X_WB.as_array(), twist, s)

    def _change(self, move: _Move) -> None:
        if move.to is None:
            raise RuntimeError("there is no stage after the last")
        self._stage, self._reason, self._since_ns = move.to, move.reason, None
        self._avoiding = None
        if move.to in (Stage.LOCALISE, Stage.BRAKE):
            self._state = self._run = self._looked_ns = None

    def _lasted(self, now: int) -> float:
        return 0.0 if self._since_ns is None else seconds(now - self._since_ns)

    def _surroundings(self, situation: Situation) -> Surroundings:
        radius = self._setup.unit_radius
        units = tuple(
            Disc(unit.name, unit.X_WB.x, unit.X_WB.y, radius[unit.name])
            for unit in (situation.target, *situation.others)
        )
        return Surroundings(
            situation.own.X_WB, situation.target.X_WB @ self._setup.X_TD, units, situation.obstacles
        )

    def _report(self, senses: Senses) -> None:
        situation, run, state = senses.situation, self._run, self._state
        if situation is None:
            self.progress = None
            return
        tip = self._tip(situation.own.X_WB)
        desired = reference = tip
        if state is not None:
            desired, reference = _point(state.desired), _point(state.guidance.position)
        self.progress = AssemblyProgress(
            stamp_ns=senses.now_ns,
            stage=self._stage.value,
            path=0 if self.path is None else self.path.number,
            tip=tip,
            desired=desired,
            reference=reference,
            s=0.0 if state is None else float(state.pace.s),
            arc_end=0.0 if run is None else float(run.route.path.arc_end),
            length=0.0 if run is None else float(run.route.path.length),
            avoiding=self._avoiding,
            reason=self._reason,
        )


def _point(place: Array) -> tuple[float, float]:
    x, y = place.tolist()
    return x, y


def _apart(tip: tuple[float, float], place: Array) -> float:
    x, y = place.tolist()
    return math.hypot(tip[0] - x, tip[1] - y)


def c1(setup: AssemblySetup, **params: Any) -> Assembler:
    """Build the paper's long-distance phase C1."""
    return LongRangeAssembler(read_params("c1", AssemblyParams, params), setup)


def c2(setup: AssemblySetup, **params: Any) -> Assembler:
    """Build the long-distance phase of the paper's comparison C2."""
    from msrr_control.comparison_assembler import ComparisonAssembler, ComparisonAssemblyParams

    return ComparisonAssembler(read_params("c2", ComparisonAssemblyParams, params), setup)


ASSEMBLERS: dict[str, Callable[..., Assembler]] = {"c1": c1, "c2": c2}


def build_assembler(choice: Choice, setup: AssemblySetup) -> Assembler:
    """Build the long-distance phase that a scene chose; it is called as ``Class(setup, **params)``.

    Raises:
        UnknownNameError: Neither a registered name nor an import path that leads anywhere.
        SceneError: Its parameters are wrong, or what the scene asks cannot work.
    """
    built = build("assembler", choice, ASSEMBLERS, setup)
    for method in ("reset", "step"):
        if not callable(getattr(built, method, None)):
            raise SceneError(f"assembler {choice.name!r} has no method {method}")
    return built
