"""The state machine of the long-distance phase: from anywhere in the arena to the place in front of the port.

========  =====================================  ================================================
State     What the unit does                     Next state
========  =====================================  ================================================
LOCALISE  stands until it and its target are     BRAKE; done if it stands in front of the port
          localised
BRAKE     comes to rest                          PLAN
PLAN      chooses a route, or waits for one      TURN; gives up after too many routes or too long
TURN      turns on the spot to the path's start  DRIVE; CLEAR if something stops the turn; BRAKE if
                                                 another route is needed
CLEAR     drives straight to where it can turn   BRAKE
DRIVE     follows the path                       SETTLE; CLEAR if something stops the unit; BRAKE if
                                                 another route is needed
SETTLE    comes to rest at the end of the path   done; BRAKE if it is not in front of the port
========  =====================================  ================================================

While localisation does not see it, the unit stands still, but in LOCALISE it turns on the spot after a while,
and gives up after too long. It knows what global localisation estimates and nothing else.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Generic, NamedTuple

from msrr_control.path_following.law import PathFollowingLaw, State
from msrr_control.planning.lane import in_lane
from msrr_control.planning.route import ArenaMap, Route
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.sequence.context import STILL
from msrr_control.sequence.observation import GiveUp, Observation
from msrr_control.staging.manoeuvres import StraightDrive, spot_turn
from msrr_control.staging.parameters import RouteFollowingParams
from msrr_control.staging.route_follower import RouteFollower, shown_path
from msrr_control.staging.setup import AssemblySetup
from msrr_scenes.geometry.se2 import wrap_angle
from msrr_scenes.messages import AssemblyPath, AssemblyProgress, FailureReason, Twist, seconds

#: Speeds below which the unit stands still [m/s], [rad/s], and the longest wait for it [s].
_STILL_MPS, _STILL_RADPS, _BRAKE_S = 0.02, 0.08, 1.5

#: Loss of heading error that counts as progress of a turn on the spot [rad].
_TURNED_RAD = math.radians(3.0)


class AssemblyState(Enum):
    """What the unit does in the long-distance phase."""

    LOCALISE = "localise"
    BRAKE = "brake"
    PLAN = "plan"
    TURN = "turn"
    CLEAR = "clear"
    DRIVE = "drive"
    SETTLE = "settle"


class _Transition(NamedTuple):
    """A change of state and its reason; to None when the unit is in front of the port."""

    to: AssemblyState | None
    reason: str


_Decision = Twist | GiveUp | _Transition


class LongDistanceAssembler(Generic[State]):
    """Leads the unit in front of the port by a long-distance law; an ``Assembler`` of the phase machine.

    Attributes:
        progress: What the unit did at the last instant, None before the first.
        path: Path that is followed or was followed last, None before the first.
    """

    def __init__(
        self, params: RouteFollowingParams, setup: AssemblySetup, law: PathFollowingLaw[State]
    ) -> None:
        """Begin before anything is known.

        Raises:
            SceneError: The facts and parameters cannot work wherever units and obstacles stand.
        """
        setup.check(params.pace.cruise_mps, params.widest_obstacle_m, params.route.border_m)
        self.params, self._setup, self._watch = params, setup, params.watch
        self._planner = RoutePlanner(
            params.route,
            params.walls,
            params.pace,
            setup.box_for(params.route.border_m),
            setup.offset,
            setup.half_width,
            setup.border,
        )
        self._follower = RouteFollower(law, self._planner, params.watch)
        self.progress: AssemblyProgress | None = None
        self.path: AssemblyPath | None = None
        self._state, self._reason = AssemblyState.LOCALISE, "start"
        self._since_ns: int | None = None  # time at which the state was entered
        self._previous_ns: int | None = None
        self._unseen_ns: int | None = None
        self._planned_ns: int | None = None
        self._least_error = (math.inf, 0)  # of a turn on the spot [rad], and the time at which it was reached
        self._straight: StraightDrive | None = None  # the way to where the unit can turn
        self._dt = 1.0 / setup.rate_hz
        self._paths, self._caution, self._came_back = 0, 0, False

    def reset(self, reason: str) -> None:
        """Begin again from wherever the unit stands, after the hand-over failed there."""
        self._paths, self._caution, self._came_back = 0, 0, True
        self._unseen_ns = self._previous_ns = None
        self._change(AssemblyState.LOCALISE, reason)

    def step(self, observation: Observation) -> Twist | GiveUp | None:
        """Return the command, None once the unit stands where the hand-over can begin, or why it gives up."""
        now = observation.now_ns
        if self._previous_ns is not None and now > self._previous_ns:
            self._dt = seconds(now - self._previous_ns)
        self._previous_ns = now
        decision = self._decide(observation)
        self.progress = self._follower.progress(observation, self._state.value, self.path, self._reason)
        return decision

    def _decide(self, observation: Observation) -> Twist | GiveUp | None:
        estimate, now = observation.arena, observation.now_ns
        if estimate is None or seconds(now - estimate.last_seen_ns) > self._watch.stale_s:
            return self._wait_to_be_seen(observation)
        if self._unseen_ns is not None:  # seen again: the law starts again where the unit is now
            self._wait_longer(now - self._unseen_ns)
            self._unseen_ns = None
            if self._follower.started:
                self._follower.restart(estimate.own.X_WB, observation.twist, now)
        arena = self._setup.map_of(estimate)
        for _ in range(2 * len(AssemblyState)):  # a state with nothing to do is passed in the same instant
            if self._since_ns is None:
                self._since_ns = now
            decision = self._act(observation, arena)
            if not isinstance(decision, _Transition):
                return decision
            if decision.to is None:
                self._reason = decision.reason
                return None
            self._change(decision.to, decision.reason)
        return STILL

    def _act(self, observation: Observation, arena: ArenaMap) -> _Decision:
        match self._state:
            case AssemblyState.LOCALISE:
                return self._localise(arena)
            case AssemblyState.BRAKE:
                return self._brake(observation)
            case AssemblyState.PLAN:
                return self._plan(observation.now_ns, arena)
            case AssemblyState.TURN:
                return self._turn(observation, arena)
            case AssemblyState.CLEAR:
                return self._clear(observation, arena)
            case AssemblyState.DRIVE:
                return self._drive(observation, arena)
            case AssemblyState.SETTLE:
                return self._settle(observation, arena)

    # The states, in the order in which they come.

    def _wait_to_be_seen(self, observation: Observation) -> Twist | GiveUp:
        """Stand still while localisation does not see the unit; at the start, turn to show another side."""
        now = observation.now_ns
        if self._unseen_ns is None:
            self._unseen_ns = now
        waited = seconds(now - self._unseen_ns)
        if waited > self._watch.lost_s:
            return observation.not_localised(waited)
        turns = self._state is AssemblyState.LOCALISE and waited > self._watch.spin_after_s
        return Twist(0.0, self._watch.spin_radps) if turns else STILL

    def _localise(self, arena: ArenaMap) -> _Decision:
        """Pass on at once, as unit and target are known; end the phase if the unit is there already."""
        if not self._came_back and self._is_there(arena):
            return _Transition(None, "stands in front of the port")
        return _Transition(AssemblyState.BRAKE, f"localised: {self._reason}")

    def _brake(self, observation: Observation) -> _Decision:
        """Come to rest."""
        v, w = abs(observation.twist.v), abs(observation.twist.w)
        stands = v < _STILL_MPS and w < _STILL_RADPS
        if stands or self._time_in_state(observation.now_ns) > _BRAKE_S:
            return _Transition(AssemblyState.PLAN, self._reason)
        return STILL

    def _plan(self, now: int, arena: ArenaMap) -> _Decision:
        """Choose a route; wait for one if there is none."""
        watch = self._watch
        if self._paths >= watch.paths:
            return GiveUp(FailureReason.BLOCKED, f"not there after {self._paths} paths: {self._reason}")
        if self._planned_ns is not None and seconds(now - self._planned_ns) < watch.retry_s:
            return STILL
        self._planned_ns = now
        route = self._find_route(arena)
        if isinstance(route, str):
            waited = self._time_in_state(now)
            if waited < watch.patience_s:
                return STILL
            reason = f"no way to the port in {waited:.1f} s: {route}; before: {self._reason}"
            return GiveUp(FailureReason.BLOCKED, reason)
        self._paths += 1
        self._follower.set_route(route, arena)
        self.path = shown_path(now, route, self.path, self._reason)
        reason = f"{route.shape} of {float(route.path.length):.2f} m: {self._reason}"
        return _Transition(AssemblyState.TURN, reason)

    def _find_route(self, arena: ArenaMap) -> Route | str:
        """Return the best route, or why there is none."""
        handover_m, half_width = self.params.route.handover_m, self._setup.half_width
        obstacle = in_lane(arena.X_WD, handover_m, half_width, arena.obstacles)
        if obstacle is not None:
            return f"{obstacle} stands in the lane to the port"
        return self._planner.plan(arena, self._caution) or self._planner.obstruction(arena)

    def _turn(self, observation: Observation, arena: ArenaMap) -> _Decision:
        """Turn on the spot to the heading with which the path begins."""
        follower, watch, time = self._follower, self._watch, self._time_in_state(observation.now_ns)
        reason = follower.reason_to_replan(arena)
        if reason is not None:
            return _Transition(AssemblyState.BRAKE, reason)
        error = wrap_angle(float(follower.route.path.start[2]) - arena.X_WU.yaw)
        tolerance = watch.aligned_deg if time > 0.0 else watch.askew_deg
        if abs(error) <= math.radians(tolerance) and abs(observation.twist.w) < 0.15:
            return _Transition(AssemblyState.DRIVE, self._reason)
        if time == 0.0 or abs(error) < self._least_error[0] - _TURNED_RAD:
            self._least_error = abs(error), observation.now_ns
        if seconds(observation.now_ns - self._least_error[1]) > watch.stuck_s:
            self._caution += 1
            return _Transition(AssemblyState.CLEAR, f"could not turn on the spot{observation.held}")
        return spot_turn(error, self.params, self._setup.limits)

    def _clear(self, observation: Observation, arena: ArenaMap) -> _Decision:
        """Drive straight, back or ahead, to where there is room to turn on the spot."""
        if self._straight is None:
            way = self._planner.margins.way_to_turn(arena, self._setup.unit_radius[self._setup.unit])
            self._straight = StraightDrive(arena.X_WU, way or 0.0)
        limits = self._setup.limits
        twist = self._straight.step(arena.X_WU, limits)
        if twist is None or self._time_in_state(observation.now_ns) > self._straight.longest_s(limits):
            return _Transition(AssemblyState.BRAKE, self._reason)
        return twist

    def _drive(self, observation: Observation, arena: ArenaMap) -> _Decision:
        """Follow the path."""
        follower, watch, now = self._follower, self._watch, observation.now_ns
        if not follower.started:
            follower.start(arena.X_WU, observation.twist, now)
        s = follower.s
        reason = follower.reason_to_replan(arena)
        if reason is not None:
            return _Transition(AssemblyState.BRAKE, reason)
        twist = follower.step(arena, s, self._dt)
        idle = follower.time_without_progress(s, now)
        remaining = float(follower.route.path.length) - s
        if remaining < 2e-3:
            return _Transition(AssemblyState.SETTLE, self._reason)
        if idle > watch.stuck_s:
            self._caution += 1
            cause = f"no progress for {watch.stuck_s:.1f} s{observation.held}"
            return _Transition(AssemblyState.CLEAR, f"{cause}, {remaining:.2f} m before the end")
        return twist

    def _settle(self, observation: Observation, arena: ArenaMap) -> _Decision:
        """Come to rest at the end of the path, and check whether the unit is in front of the port."""
        follower, watch = self._follower, self._watch
        if follower.started:
            close = follower.distance_to_end(arena.X_WU) < 0.5 * watch.there_m
            rests = abs(observation.twist.v) < _STILL_MPS and close
            if not rests and self._time_in_state(observation.now_ns) < watch.settle_s:
                return follower.step(arena, math.inf, self._dt)
        if not follower.route.final:
            return _Transition(AssemblyState.BRAKE, "turn on the spot before the port")
        if self._is_there(arena):
            return _Transition(None, "in front of the port")
        return _Transition(AssemblyState.BRAKE, "not where the path should end")

    # What the states share.

    def _is_there(self, arena: ArenaMap) -> bool:
        """Return whether the unit stands on the place in front of the port.

        That is the end of the path, and the straight way from there to where a failed attempt begins again.
        """
        tip, yaw = self._follower.tip(arena.X_WU), arena.X_WU.yaw - arena.X_WD.yaw
        (x, y), end = arena.X_WD.inverse().act(tip), -self.params.route.handover_m
        off = math.hypot(x - min(max(x, end), max(-self._setup.approach_m, end)), y)
        return off <= self._watch.there_m and abs(wrap_angle(yaw)) <= math.radians(self._watch.there_deg)

    def _change(self, state: AssemblyState, reason: str) -> None:
        self._state, self._reason, self._since_ns, self._straight = state, reason, None, None
        self._follower.clear_avoided()
        if state in (AssemblyState.LOCALISE, AssemblyState.BRAKE):
            self._follower.drop_route()
            self._planned_ns = None

    def _wait_longer(self, unseen_ns: int) -> None:
        """Count no time in which the unit was not seen as time in which it was held, or found no route."""
        if self._since_ns is not None:
            self._since_ns += unseen_ns
        error, reached_ns = self._least_error
        self._least_error = error, reached_ns + unseen_ns

    def _time_in_state(self, now: int) -> float:
        return 0.0 if self._since_ns is None else seconds(now - self._since_ns)
