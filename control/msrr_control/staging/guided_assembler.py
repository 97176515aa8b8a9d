"""The long-distance phase of a unit that a base station leads: it drives granted routes, as far as it may."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Generic

from msrr_control.path_following.law import PathFollowingLaw, State
from msrr_control.planning.route import ArenaMap, Route
from msrr_control.planning.route_planner import RoutePlanner
from msrr_control.sequence.context import STILL
from msrr_control.sequence.observation import GiveUp, Observation
from msrr_control.staging.manoeuvres import StraightDrive, spot_turn
from msrr_control.staging.parameters import RouteFollowingParams
from msrr_control.staging.route_follower import RouteFollower, shown_path
from msrr_control.staging.setup import AssemblySetup
from msrr_control.tracks.authority import MovementAuthority
from msrr_control.tracks.track import path_of
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import AssemblyPath, AssemblyProgress, Twist, seconds
from msrr_scenes.messages.coordination import Authority, LegKind

#: Speed below which a unit stands still [m/s], [rad/s].
_STILL_MPS, _STILL_RADPS = 0.02, 0.05

#: Distance from where it has to wait, and time there, after which a unit stays as it is [m], [s]. By then the
#: law has brought it there: others may count on the whole way.
_HOLD_M, _HOLD_AFTER_S = 0.005, 2.0

#: Heading error at which a turn on the spot ends [rad].
_ALIGNED_RAD = math.radians(2.0)

#: Heading error up to which a unit faces the end of its route [rad]. The base station, which sees it with an
#: error of its own, accepts :class:`~msrr_control.coordination.goal_tolerance.GoalTolerance`.
_FACES_RAD = math.radians(1.0)

#: Way before the end of a route in the open that is not covered before the unit stands there as it is to [m]:
#: one that reports the whole way, and stands, has arrived.
_LAST_M = 0.02


class GuidedAssembler(Generic[State]):
    """Drives the legs of granted routes one after the other; an ``Assembler`` of the phase machine.

    It stops where its authority ends, and gives the unit to the close-range phase at the beginning of the
    dock leg, which is granted whole or not at all. A leg backwards out of a port is not its matter: it begins
    after it.

    Attributes:
        authority: Keeps the newest authority.
        finished: Whether the unit stands at the end of a route that ends in the open.
        progress: What the unit did at the last instant; None before the first.
        path: Path that is followed or was followed last; None before the first.
        covered: Arc length of the route that the unit has covered [m].
    """

    def __init__(
        self,
        params: RouteFollowingParams,
        setup: AssemblySetup,
        law: PathFollowingLaw[State],
        reaction_s: float,
    ) -> None:
        """Begin without an authority.

        ``reaction_s`` is the longest time from a state to the effect on the wheels of what is decided on it.
        """
        self.params, self._setup, self._watch = params, setup, params.watch
        planner = RoutePlanner(
            params.route, params.walls, params.pace, setup.box, setup.offset, setup.half_width
        )
        self._follower = RouteFollower(law, planner, params.watch)
        self.authority = MovementAuthority(setup.limits, reaction_s)
        self.progress: AssemblyProgress | None = None
        self.path: AssemblyPath | None = None
        self.covered = 0.0
        self.finished = False
        self._leg: int | None = None  # leg that is being driven
        self._end_yaw: float | None = None  # heading at the end of the route in the open, once it is driven
        self._previous_ns: int | None = None
        self._unseen_ns: int | None = None
        self._waits: tuple[float, int] | None = None  # where the unit waits on the path [m], since when [ns]
        self._asked: Twist | None = None  # last command of the law; None if the last command was not its own
        self._dt = 1.0 / setup.rate_hz
        self._stage, self._reason = "localise", "waits for an authority"

    def receive(self, authority: Authority) -> None:
        """Take in an authority; one of another route replaces the route."""
        if self.authority.receive(authority):
            self._leg, self._end_yaw, self.covered, self.finished = None, None, 0.0, False
            self._follower.drop_route()

    def reset(self, reason: str) -> None:
        """Begin again where the unit stands, which is in its dock leg."""
        self._reason = reason

    def step(self, observation: Observation) -> Twist | GiveUp | None:
        """Return the command, None at the beginning of the dock leg, or why the unit gives up."""
        now = observation.now_ns
        if self._previous_ns is not None and now > self._previous_ns:
            self._dt = seconds(now - self._previous_ns)
        self._previous_ns = now
        share, self._asked = self._share_passed(observation.passed), None
        decision = self._decide(observation, share)
        self.progress = self._follower.progress(observation, self._stage, self.path, self._reason)
        return decision

    def _decide(self, observation: Observation, share: float) -> Twist | GiveUp | None:
        estimate, now = observation.arena, observation.now_ns
        if estimate is None or seconds(now - estimate.last_seen_ns) > self._watch.stale_s:
            return self._wait_to_be_seen(observation)
        if self._unseen_ns is not None:
            self._unseen_ns = None
            if self._follower.started:
                self._follower.restart(estimate.own.X_WB, observation.twist, now)
        # The route leads around all that stands. A wall or a potential beside an obstacle would lead the unit
        # off it, onto ground that others count on.
        arena = ArenaMap(estimate.own.X_WB, estimate.own.X_WB, (), ())
        if self._end_yaw is not None:
            return self._face_end(observation, arena.X_WU.yaw)
        legs = self.authority.legs
        for _ in range(len(legs) + 1):  # a leg with nothing left is passed in the same instant
            if self._leg is None and not self._begin_next(arena, now):
                return STILL
            assert self._leg is not None
            kind = legs[self._leg].kind
            limit = self.authority.limit(now, self.covered, abs(observation.twist.v))
            if kind is LegKind.DOCK:
                self._stage = "settle"
                return None if limit >= legs[self._leg].end - 1e-9 and self._rests(observation) else STILL
            if kind is LegKind.TURN:
                twist = self._turn(observation, arena, limit)
            elif kind is LegKind.REVERSE:
                twist = self._reverse(observation, arena, limit)
            else:
                twist = self._drive(observation, arena, limit, share)
            if twist is not None:
                return twist
            if self._leg + 1 == len(legs):
                self._end_yaw = self.authority.end_yaw
                return self._face_end(observation, arena.X_WU.yaw)
            self.covered = legs[self._leg].end
            self._begin(self._leg + 1, arena, now)
        return STILL

    def _begin_next(self, arena: ArenaMap, now: int) -> bool:
        """Begin the route if there is one; return whether there is."""
        if not self.authority.legs:
            self._stage, self._reason = "plan", "waits for an authority"
            return False
        legs = self.authority.legs
        first = 1 if legs[0].kind is LegKind.BACK else 0
        if first == len(legs):
            self._stage, self._reason, self.finished = "settle", "at the end of the route", True
            return False
        self.covered = self._start_of(first)
        self._begin(first, arena, now)
        return True

    def _begin(self, index: int, arena: ArenaMap, now: int) -> None:
        self._leg, self._waits = index, None
        self._follower.drop_route()
        leg = self.authority.legs[index]
        self._reason = f"leg {index + 1} of {len(self.authority.legs)}: {leg.kind.value}"
        if leg.kind is not LegKind.PATH:
            return
        route = Route(path_of(leg), "granted", MappingProxyType({}), 0.0)  # of no expected duration
        self._follower.set_route(route, arena)
        self.path = shown_path(now, route, self.path, self._reason)

    # The legs: each returns a command, or None at its end.

    def _turn(self, observation: Observation, arena: ArenaMap, limit: float) -> Twist | None:
        """Turn on the spot as granted; the arc length counts the way of the controlled point."""
        assert self._leg is not None
        leg, begin = self.authority.legs[self._leg], self._start_of(self._leg)
        self._stage = "turn"
        # The heading counts from the middle of the turn: neither way round is the nearer one in a half turn.
        middle = 0.5 * leg.turn
        error = middle - wrap_angle(arena.X_WU.yaw - leg.start[2] - middle)
        self.covered = max(self.covered, leg.end - self._setup.offset * abs(error))
        if abs(error) < _ALIGNED_RAD and abs(observation.twist.w) < _STILL_RADPS:
            return None
        # A unit that has turned too far, because its drive lags, turns back over ground that it has covered.
        # One that came in askew, by more than the leg turns, turns as far as the limit all the same.
        beyond, left = error * leg.turn < 0.0, max(leg.end - limit, 0.0) / self._setup.offset
        allowed = max(abs(error) - left, 0.0) if limit > begin else 0.0
        allowed = math.inf if beyond else allowed
        return spot_turn(error, self.params, self._setup.limits, allowed)

    def _reverse(self, observation: Observation, arena: ArenaMap, limit: float) -> Twist | None:
        """Drive straight back, as far as granted."""
        assert self._leg is not None
        leg, begin = self.authority.legs[self._leg], self._start_of(self._leg)
        self._stage = "reverse"
        X_WS = SE2(*leg.start)
        self.covered = max(self.covered, min(begin - (X_WS.inverse() @ arena.X_WU).x, leg.end))
        way = min(limit, leg.end) - begin
        twist = StraightDrive(X_WS, -way).step(arena.X_WU, self._setup.limits) if way > 0.0 else None
        if twist is not None:
            return twist
        return None if limit >= leg.end and self._rests(observation) else STILL

    def _face_end(self, observation: Observation, yaw: float) -> Twist:
        """Turn to the heading in which the route ends, then stand.

        The law has brought the controlled point to the end of the path, whatever heading it came in with; and
        others count on the place in which the unit is to stand.
        """
        assert self._end_yaw is not None
        error, end = wrap_angle(self._end_yaw - yaw), self.authority.legs[-1].end
        if self.authority.limit(observation.now_ns, self.covered, 0.0) < end - 1e-9:
            return STILL  # the authority has not been renewed
        if not self.finished and (abs(error) >= _FACES_RAD or not self._rests(observation)):
            self._stage = "turn"
            return spot_turn(error, self.params, self._setup.limits)
        self.covered, self.finished = end, True
        self._stage, self._reason = "settle", "at the end of the route"
        return STILL

    def _drive(self, observation: Observation, arena: ArenaMap, limit: float, share: float) -> Twist | None:
        """Follow the path of the leg, and come to rest where the authority or the path ends.

        Time passes for the law as fast as the unit is let drive, so that it stays on the path. A law that
        went on without the unit would lead it straight to where it is by then, over ground that nobody has
        granted, and at the body for which the collision monitor holds the unit.
        """
        assert self._leg is not None
        follower, now = self._follower, observation.now_ns
        leg, begin = self.authority.legs[self._leg], self._start_of(self._leg)
        offset = self._setup.offset
        self._stage = "drive"
        if limit <= begin and not follower.started:
            return STILL
        if not follower.started:
            follower.start(arena.X_WU, observation.twist, now)
        allowed = limit - begin + offset
        if self._has_waited(allowed, now) and self._rests(observation):
            return STILL  # the law would creep after the noise of the estimate for as long as the unit waits
        if share == 0.0:
            follower.hold(arena.X_WU, observation.twist, now)
        twist = follower.step(arena, follower.s, (share or 1.0) * self._dt, limit=allowed)
        self._asked = twist
        lag = math.dist(follower.tip(arena.X_WU), follower.position)
        last = self._leg + 1 == len(self.authority.legs)
        end = leg.end - _LAST_M if last else leg.end
        self.covered = max(self.covered, min(begin + follower.s - offset - lag, end))
        remaining = float(follower.route.path.length) - follower.s
        if remaining > 2e-3:
            return twist
        self._stage = "settle"
        near = follower.distance_to_end(arena.X_WU) < 0.5 * self._watch.there_m
        if (near and self._rests(observation)) or self._stalled(now):
            return None
        return twist

    # What the legs share.

    def _stalled(self, now: int) -> bool:
        return self._follower.time_without_progress(self._follower.s, now) > self._watch.settle_s

    def _has_waited(self, allowed: float, now: int) -> bool:
        """Return whether the unit has been for a while where it must wait, at arc length ``allowed`` [m]."""
        follower = self._follower
        there = allowed < follower.s + _HOLD_M and allowed < follower.route.path.length
        if not there or self._waits is None or allowed != self._waits[0]:
            self._waits = (allowed, now) if there else None
        return self._waits is not None and seconds(now - self._waits[1]) > _HOLD_AFTER_S

    def _share_passed(self, passed: Twist | None) -> float:
        """Return the share of the last command of the law that the collision monitor let pass."""
        if self._asked is None or passed is None:
            return 1.0
        parts = ((self._asked.v, passed.v), (self._asked.w, passed.w))
        return min((done / asked for asked, done in parts if asked), default=1.0)

    def _start_of(self, index: int) -> float:
        return self.authority.legs[index - 1].end if index else 0.0

    def _rests(self, observation: Observation) -> bool:
        return abs(observation.twist.v) < _STILL_MPS and abs(observation.twist.w) < _STILL_RADPS

    def _wait_to_be_seen(self, observation: Observation) -> Twist | GiveUp:
        now = observation.now_ns
        if self._unseen_ns is None:
            self._unseen_ns = now
        waited = seconds(now - self._unseen_ns)
        if waited > self._watch.lost_s:
            return observation.not_localised(waited)
        return STILL
