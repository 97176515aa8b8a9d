"""The long-distance phase: from anywhere in the arena to the place in front of the port.

::

    LOCALISE -> PLAN -> TURN -> DRIVE -> SETTLE -> (hand-over)
                 ^                |        |
                 |                v        |
                 +-------------- BRAKE <---+  (stopped, something new on the path, a stage reached, not there)

The unit knows what global localisation tells it and nothing else. Each stage is one method: it returns a
twist to stay, a :class:`_Transition` to another stage, or why the unit gives up.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Generic, NamedTuple

from msrr_control.path_following.law import PathFollowingLaw
from msrr_control.planning.free_space import Disc
from msrr_control.planning.route import Surroundings
from msrr_control.planning.route_planner import RoutePlanner, blocking
from msrr_control.sequence.observation import GiveUp, Observation
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.route_follower import RouteFollower, State
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.geometry.se2 import wrap_angle
from msrr_scenes.messages import ArenaEstimate, AssemblyPath, AssemblyProgress, FailureReason, Twist, seconds

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


class _Transition(NamedTuple):
    """A change of stage and why; to None when the unit is there."""

    to: Stage | None
    reason: str


class LongDistanceAssembler(Generic[State]):
    """Leads the unit in front of the port by a long-distance law.

    Attributes:
        progress: What it did at the last instant, None before the first.
        path: The path it follows or followed last, None before the first.
    """

    def __init__(self, params: AssemblyParams, setup: AssemblySetup, law: PathFollowingLaw[State]) -> None:
        """Begin before anything is known.

        Args:
            params: Of the paths and of the unit's patience.
            setup: What the unit is told by its makers and by the plan.
            law: Drives along the paths.

        Raises:
            SceneError: What is asked cannot work wherever things stand.
        """
        setup.check(params.pace.cruise_mps, params.widest_obstacle_m, params.route.border_m)
        self.params, self._setup, self._watch = params, setup, params.watch
        self._planner = RoutePlanner(
            params.route, params.walls, params.pace, setup.box, setup.offset, setup.half_width
        )
        self._follower = RouteFollower(law, self._planner, params, setup)
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
        self._paths, self._caution, self._came_back = 0, 0, False

    @property
    def stage(self) -> Stage:
        """What the unit does."""
        return self._stage

    def reset(self, reason: str) -> None:
        """Begin again from wherever the unit stands: the hand-over failed there."""
        self._paths, self._caution, self._came_back = 0, 0, True
        self._unseen_ns = self._then_ns = None
        self._change(_Transition(Stage.LOCALISE, reason))

    def step(self, senses: Observation) -> Twist | GiveUp | None:
        """Return the command, None once the unit stands where the hand-over can begin, or why it gives up."""
        now = senses.now_ns
        if self._then_ns is not None and now > self._then_ns:
            self._dt = seconds(now - self._then_ns)
        self._then_ns = now
        decision = self._decide(senses)
        self._report(senses)
        return decision

    def _decide(self, senses: Observation) -> Twist | GiveUp | None:
        situation, now = senses.situation, senses.now_ns
        if situation is None or seconds(now - situation.last_seen_ns) > self._watch.stale_s:
            return self._wait_to_be_seen(now)
        if self._unseen_ns is not None:  # seen again: the law begins anew where the unit is now
            self._unseen_ns = None
            if self._follower.moves:
                self._follower.start(situation.own.X_WB, senses.twist, now, self._follower.s)
        around = self._surroundings(situation)
        for _ in range(2 * len(Stage)):  # a stage that has nothing to do is passed in the same instant
            if self._since_ns is None:
                self._since_ns = now
            decision = self._stages[self._stage](senses, around)
            if not isinstance(decision, _Transition):
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
            return GiveUp(FailureReason.NOT_LOCALISED, f"not localised for {waited:.1f} s")
        turns = self._stage is Stage.LOCALISE and waited > self._watch.spin_after_s
        return Twist(0.0, self._watch.spin_radps) if turns else _STILL

    def _localise(self, senses: Observation, around: Surroundings) -> Twist | GiveUp | _Transition:
        """Passed as soon as unit and target are known; so is the rest if the unit stands there already."""
        if not self._came_back and self._is_there(around):
            return _Transition(None, "stands in front of the port")
        return _Transition(Stage.BRAKE, f"localised: {self._reason}")

    def _brake(self, senses: Observation, around: Surroundings) -> Twist | GiveUp | _Transition:
        """Come to rest."""
        v, w = abs(senses.twist.v), abs(senses.twist.w)
        if (v < _STANDS_MPS and w < _STANDS_RADPS) or self._lasted(senses.now_ns) > _BRAKE_S:
            return _Transition(Stage.PLAN, self._reason)
        return _STILL

    def _plan(self, senses: Observation, around: Surroundings) -> Twist | GiveUp | _Transition:
        """Choose a path; wait for one if there is none."""
        watch, now = self._watch, senses.now_ns
        if self._paths >= watch.paths:
            return GiveUp(FailureReason.BLOCKED, f"not there after {self._paths} paths: {self._reason}")
        if self._looked_ns is not None and seconds(now - self._looked_ns) < watch.retry_s:
            return _STILL
        self._looked_ns = now
        route = self._planner.plan(around, self._caution)
        if route is None:
            waited = self._lasted(now)
            if waited < watch.patience_s:
                return _STILL
            where = blocking(around, self._planner)
            return GiveUp(
                FailureReason.BLOCKED, f"no way to the port in {waited:.1f} s{where}; {self._reason}"
            )
        self._paths += 1
        self._follower.take(route, around)
        _, points = route.path.sample(0.05)
        number = 1 if self.path is None else self.path.number + 1
        shown = tuple((float(x), float(y)) for x, y in points)
        self.path = AssemblyPath(now, number, route.shape, shown, self._reason)
        return _Transition(Stage.TURN, f"{route.shape} of {float(route.path.length):.2f} m: {self._reason}")

    def _turn(self, senses: Observation, around: Surroundings) -> Twist | GiveUp | _Transition:
        """Turn on the spot to where the path begins."""
        follower, watch = self._follower, self._watch
        trouble = follower.trouble(around)
        if trouble is not None:
            return _Transition(Stage.BRAKE, trouble)
        off = wrap_angle(float(follower.route.path.start[2]) - around.X_WU.yaw)
        began = self._lasted(senses.now_ns) > 0.0
        if abs(off) <= (watch.aligned if began else watch.askew) and abs(senses.twist.w) < 0.15:
            return _Transition(Stage.DRIVE, self._reason)
        if self._lasted(senses.now_ns) > _TURN_S:
            self._caution += 1
            return _Transition(Stage.BRAKE, "could not turn on the spot")
        most = min(0.7 * self._setup.limits.w_max_radps, 1.0)
        return Twist(0.0, min(max(self.params.turn_per_s * off, -most), most))

    def _drive(self, senses: Observation, around: Surroundings) -> Twist | GiveUp | _Transition:
        """Follow the path."""
        follower, watch, now = self._follower, self._watch, senses.now_ns
        if not follower.moves:
            follower.begin(around.X_WU, senses.twist, now)
        s = follower.s
        trouble = follower.trouble(around)
        if trouble is not None:
            return _Transition(Stage.BRAKE, trouble)
        twist = follower.step(around, s, self._dt)
        idle = follower.without_progress(s, now)
        left = float(follower.route.path.length) - s
        if left < 2e-3:
            return _Transition(Stage.SETTLE, self._reason)
        if idle > watch.stuck_s:
            self._caution += 1
            return _Transition(
                Stage.BRAKE, f"no progress for {watch.stuck_s:.1f} s, {left:.2f} m before the end"
            )
        return twist

    def _settle(self, senses: Observation, around: Surroundings) -> Twist | GiveUp | _Transition:
        """Come to rest at the end of the path, and say whether that is the place."""
        follower = self._follower
        if follower.moves:
            close = follower.from_end(around.X_WU) < 0.5 * self._watch.there_m
            rests = abs(senses.twist.v) < _STANDS_MPS and close
            if not rests and self._lasted(senses.now_ns) < self._watch.settle_s:
                return follower.step(around, math.inf, self._dt)
        if not follower.route.final:
            return _Transition(Stage.BRAKE, "turn on the spot before the port")
        if self._is_there(around):
            return _Transition(None, "in front of the port")
        return _Transition(Stage.BRAKE, "not where the path should end")

    # What they share.

    def _is_there(self, around: Surroundings) -> bool:
        x, y = self._follower.tip(around.X_WU)
        end = self._planner.handover(around.X_WD)
        near = math.hypot(x - end.x, y - end.y) <= self._watch.there_m
        return near and abs(wrap_angle(around.X_WU.yaw - end.yaw)) <= math.radians(self._watch.there_deg)

    def _change(self, move: _Transition) -> None:
        if move.to is None:
            raise RuntimeError("there is no stage after the last")
        self._stage, self._reason, self._since_ns = move.to, move.reason, None
        self._follower.forget_wall()
        if move.to in (Stage.LOCALISE, Stage.BRAKE):
            self._follower.drop()
            self._looked_ns = None

    def _lasted(self, now: int) -> float:
        return 0.0 if self._since_ns is None else seconds(now - self._since_ns)

    def _surroundings(self, situation: ArenaEstimate) -> Surroundings:
        radius = self._setup.unit_radius
        units = tuple(
            Disc(unit.name, unit.X_WB.x, unit.X_WB.y, radius[unit.name])
            for unit in (situation.target, *situation.others)
        )
        return Surroundings(
            situation.own.X_WB, situation.target.X_WB @ self._setup.X_TD, units, situation.obstacles
        )

    def _report(self, senses: Observation) -> None:
        if senses.situation is None:
            self.progress = None
            return
        number = 0 if self.path is None else self.path.number
        self.progress = self._follower.progress(
            senses.situation.own.X_WB, senses.now_ns, self._stage.value, number, self._reason
        )
