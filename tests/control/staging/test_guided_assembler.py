"""Units led by a coordinator: the law drives granted routes, with the drive's limits and noise."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from msrr_control.coordination.coordinator import Coordinator
from msrr_control.coordination.ledger import SAME_M
from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.kinematics.unicycle import advance_pose, drive
from msrr_control.path_following.c1 import C1PathFollowingLaw
from msrr_control.path_following.path import Path
from msrr_control.sequence.observation import GiveUp, Observation
from msrr_control.shapes.bodies import Body
from msrr_control.shapes.shape import Shape
from msrr_control.staging.guided_assembler import GuidedAssembler
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.registry import build_guided
from msrr_control.staging.setup import AssemblySetup
from msrr_control.tracks.route_params import RouteParams
from msrr_control.tracks.track import track_of
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.messages import ArenaEstimate, FailureReason, GlobalPose, ObstacleEstimate, Twist
from msrr_scenes.messages.coordination import Authority, LegKind, MissionState, RouteLeg, UnitMode, UnitReport
from msrr_scenes.specs.bodies import ArenaSpec
from msrr_scenes.specs.mission import ShapeSpec
from msrr_scenes.specs.spec import Choice
from msrr_scenes.specs.vehicle import LimitsSpec

DT_NS = 20_000_000
BOX = (-2.0, 2.0, -1.5, 1.5)
LIMITS = LimitsSpec.model_validate({})
GEOMETRY = read_unit(find_urdf("unit.urdf"))
PARAMS = AssemblyParams()
#: A control period and the lag of the drive.
REACTION_S = 0.02 + 1.0 / LIMITS.kappa_per_s
DOCK_MPS, LOCK_S = 0.11, 2.0


def setup_of(unit: str, others: tuple[str, ...]) -> AssemblySetup:
    body = Body.of(GEOMETRY)
    return AssemblySetup(
        unit=unit,
        target=others[0],
        offset=body.offset,
        half_width=body.half_width,
        X_TD=GEOMETRY.dock_frame("rear"),
        unit_radius=dict.fromkeys((unit, *others), body.radius),
        obstacle_radius={},
        arena=ArenaSpec(),
        in_view=None,
        limits=LIMITS,
        rate_hz=50.0,
        sigmas=2.0,
        approach_m=0.45,
    )


@dataclass
class Unit:
    """A unit with the drive of eq. 3; the close-range phase is a straight way at constant speed.

    Of the commands of the long-distance phase, the collision monitor lets the share ``passes`` pass.
    """

    name: str
    X_WU: SE2
    assembler: GuidedAssembler[object]
    twist: np.ndarray = field(default_factory=lambda: np.zeros(2))
    docked_to: str | None = None
    docking_s: float | None = None
    most_over: float = -math.inf
    most_off: float = 0.0
    gave_up: GiveUp | None = None
    passes: float = 1.0
    passed: Twist | None = None

    def step(self, now_ns: int, arena: ArenaEstimate | None) -> None:
        newest = self.assembler.authority.newest
        if self.docked_to is not None:
            return
        if self.docking_s is not None:
            self._dock(newest)
            return
        twist = Twist(*self.twist.tolist())
        decision = self.assembler.step(Observation(now_ns, twist=twist, arena=arena, passed=self.passed))
        if isinstance(decision, GiveUp):
            self.gave_up, decision = decision, Twist()
        if decision is None:
            self.docking_s, self.twist = 0.0, np.zeros(2)
            return
        self.passed = Twist(self.passes * decision.v, self.passes * decision.w)
        command = np.array([self.passed.v, self.passed.w])
        self.twist, mean = drive(self.twist, command, LIMITS, 1e-9 * DT_NS)
        moved = 1e-9 * DT_NS * mean
        self.X_WU = SE2(*advance_pose(self.X_WU.as_array(), moved[0], moved[1]).tolist())

    def _dock(self, newest: Authority | None) -> None:
        assert newest is not None
        assert self.docking_s is not None
        self.docking_s += 1e-9 * DT_NS
        leg = newest.legs[-1]
        way = min(DOCK_MPS * self.docking_s, leg.end - newest.legs[-2].end)
        start = SE2(*leg.start)
        self.X_WU = start @ SE2(way, 0.0, 0.0)
        if DOCK_MPS * self.docking_s > leg.end - newest.legs[-2].end + DOCK_MPS * LOCK_S:
            self.docked_to = newest.to

    def report(self, now_ns: int) -> UnitReport:
        newest = self.assembler.authority.newest
        covered = self.assembler.covered
        if newest is not None and self.docking_s is not None:
            covered = min(
                self.assembler.authority.dock_start + DOCK_MPS * self.docking_s, newest.legs[-1].end
            )
        rests = bool(np.abs(self.twist).max() < 0.02) and self.docking_s is None
        mode = UnitMode.STANDING if rests else UnitMode.DRIVING
        if self.docking_s is not None:
            mode = UnitMode.DOCKING if self.docked_to is None else UnitMode.DOCKED
        seq, route = (newest.seq, newest.route) if newest else (0, 0)
        return UnitReport(self.name, now_ns, seq, route, covered, mode, self.docked_to)


class Fleet:
    """A mission of units that the coordinator hears and sees, with noise on what is seen."""

    def __init__(self, starts: dict[str, SE2], mission: Mission, seed: int = 0) -> None:
        self.body = Body.of(GEOMETRY)
        params = RouteParams(PARAMS.route, PARAMS.walls, PARAMS.pace)
        self.coordinator = Coordinator(mission, starts, CoordinationSetup.of(GEOMETRY, params, BOX))
        self.units = {
            name: self._unit(name, X, tuple(n for n in starts if n != name)) for name, X in starts.items()
        }
        self.rng = np.random.default_rng(seed)
        self.now_ns = 0
        self.least_gap = math.inf
        self.granted: dict[tuple[str, int], Authority] = {}

    def _unit(self, name: str, X: SE2, others: tuple[str, ...]) -> Unit:
        setup = setup_of(name, others)
        law = C1PathFollowingLaw(PARAMS, LIMITS, setup.offset)
        return Unit(name, X, GuidedAssembler(PARAMS, setup, law, REACTION_S))

    def seen(self, unit: Unit) -> GlobalPose:
        n = self.rng.standard_normal(3)
        X = unit.X_WU
        noisy = SE2(X.x + 5e-4 * n[0], X.y + 5e-4 * n[1], X.yaw + 2e-3 * n[2])
        return GlobalPose(unit.name, self.now_ns, noisy, 1e-6 * np.eye(3))

    def step(self) -> None:
        self.now_ns += DT_NS
        seen = {name: self.seen(unit) for name, unit in self.units.items()}
        for name, unit in self.units.items():
            others = tuple(pose for other, pose in seen.items() if other != name)
            unit.step(
                self.now_ns, ArenaEstimate(self.now_ns, seen[name], others[0], others[1:], (), self.now_ns)
            )
        if self.now_ns % 200_000_000 == 0:
            for unit in self.units.values():
                self.coordinator.receive(unit.report(self.now_ns), self.now_ns)
        if self.now_ns % 100_000_000 == 0:
            self.coordinator.observe(list(seen.values()), self.now_ns)
            self._judge()
        for message in self.coordinator.step(self.now_ns):
            self.granted[message.unit, message.route] = message
            self.units[message.unit].assembler.receive(message)

    def _judge(self) -> None:
        for a, b in itertools.combinations(self.units.values(), 2):
            partners = [u.assembler.authority.newest for u in (a, b) if u.docking_s is not None]
            if any(p is not None and (p.to or "").partition(".")[0] in (a.name, b.name) for p in partners):
                continue
            gap = float(self.body.gaps(a.X_WU.as_array(), b.X_WU.as_array()))
            self.least_gap = min(self.least_gap, gap)
        for unit in self.units.values():
            newest = unit.assembler.authority.newest
            if newest is not None and unit.docking_s is None and unit.docked_to is None:
                limit = self.granted[unit.name, newest.route].limit
                unit.most_over = max(unit.most_over, unit.assembler.covered - max(limit, 0.0))

    def run(self, seconds: float) -> MissionState:
        while self.now_ns < 1e9 * seconds:
            self.step()
            if self.coordinator.status(self.now_ns).state is not MissionState.RUNNING:
                break
        return self.coordinator.status(self.now_ns).state


STARTS = {
    "a": SE2(-1.5, -0.9, 0.4),
    "b": SE2(0.2, -0.1, -0.3),
    "c": SE2(-1.4, 0.8, -1.0),
    "d": SE2(1.4, 1.0, 2.5),
}


@pytest.mark.parametrize("pattern", ["cross", "line"])
def test_a_shape_is_built_by_the_law_on_granted_ground(pattern: str) -> None:
    """Nobody touches, nobody passes the limit by more than a few millimetres, and everybody arrives."""
    fleet = Fleet(STARTS, Mission(shape=Shape.of(ShapeSpec.model_validate({pattern: 4}))))
    assert fleet.run(150.0) is MissionState.COMPLETE, fleet.coordinator.status(fleet.now_ns).reason
    assert fleet.least_gap > 0.015
    assert max(unit.most_over for unit in fleet.units.values()) < 0.01
    assert sum(unit.docked_to is not None for unit in fleet.units.values()) == 3


@pytest.fixture
def granted() -> tuple[Unit, Authority]:
    """A unit with the authority for a route: turn, path, dock."""
    fleet = Fleet(STARTS, Mission(shape=Shape.of(ShapeSpec(line=4))))
    while True:
        fleet.step()
        for (name, _), message in fleet.granted.items():
            kinds = [leg.kind for leg in message.legs]
            if kinds[:1] == [LegKind.TURN] and kinds[-1] is LegKind.DOCK and message.legs[-2].end > 0.8:
                unit = fleet._unit(name, STARTS[name], tuple(n for n in STARTS if n != name))
                return unit, message
        assert fleet.now_ns < 60e9


def arena_of(unit: Unit, now_ns: int) -> ArenaEstimate:
    own = GlobalPose(unit.name, now_ns, unit.X_WU, 1e-6 * np.eye(3))
    far = GlobalPose(next(n for n in STARTS if n != unit.name), now_ns, SE2(9.0, 9.0, 0.0), 1e-6 * np.eye(3))
    return ArenaEstimate(now_ns, own, far, (), (), now_ns)


def follow(
    unit: Unit, message: Authority, limit: float, seconds: float, now_ns: int, renew: bool = True
) -> int:
    """Let the unit drive with an authority up to ``limit`` that is renewed at 5 Hz; return the time."""
    end_ns, seq = now_ns + round(1e9 * seconds), message.seq + now_ns
    first = True
    while now_ns < end_ns and unit.docking_s is None:
        if (renew and now_ns % 200_000_000 == 0) or first:
            seq += 1
            unit.assembler.receive(replace(message, seq=seq, limit=limit, expires_ns=now_ns + 3_000_000_000))
            first = False
        now_ns += DT_NS
        unit.step(now_ns, arena_of(unit, now_ns))
    return now_ns


@pytest.mark.parametrize("off", [-0.1, 0.0, 0.1])
@pytest.mark.parametrize("turn", [-math.pi, math.pi])
def test_a_half_turn_goes_the_way_round_that_was_granted(turn: float, off: float) -> None:
    """Others keep out of the poses of the granted turn; the other way round the body passes other poses."""
    yaw, halfway = -2.4, SE2(0.0, 0.0, -2.4 + 0.5 * turn)
    unit = Fleet(STARTS, Mission())._unit("a", SE2(0.0, 0.0, yaw + off), ("b", "c", "d"))
    leg = RouteLeg(LegKind.TURN, (0.0, 0.0, yaw), (), (), turn, 0.1 * math.pi)
    message = Authority("a", 1, 1, 0, 3_000_000_000, leg.end, (leg,), None, False)
    now_ns = follow(unit, message, 0.5 * leg.end, 8.0, 0)
    assert abs((halfway.inverse() @ unit.X_WU).yaw) < 0.1
    follow(unit, message, leg.end, 8.0, now_ns)
    assert unit.assembler.finished
    assert abs(abs(wrap_angle(unit.X_WU.yaw - yaw)) - math.pi) < 0.05


@pytest.mark.parametrize("turn", [-0.7, 0.7])
def test_a_unit_that_turned_too_far_turns_back_at_once(turn: float) -> None:
    """By the lag of its drive. What was still granted ahead, next to nothing, had throttled the way back."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(), ("b", "c", "d"))
    leg = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), turn, 0.1 * abs(turn))
    message = Authority("a", 1, 1, 0, 3_000_000_000, leg.end, (leg,), None, False)
    now_ns = follow(unit, message, leg.end, 0.9, 0)
    unit.X_WU = SE2(0.0, 0.0, 0.999 * turn)
    now_ns = follow(unit, message, leg.end, 0.02, now_ns)
    assert not unit.assembler.finished
    unit.X_WU = SE2(0.0, 0.0, 1.15 * turn)
    follow(unit, message, leg.end, 3.0, now_ns)
    assert unit.assembler.finished
    assert unit.X_WU.yaw == pytest.approx(turn, abs=0.05)


@pytest.mark.parametrize("turn", [-0.02, 0.02])
def test_a_unit_that_came_in_askew_turns_at_once_although_its_leg_hardly_turns(turn: float) -> None:
    """It had crept by 1 deg/s, as what the leg turns limited its rate, until the base station recalled it."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(0.0, 0.0, -6.0 * turn), ("b", "c", "d"))
    leg = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), turn, 0.1 * abs(turn))
    message = Authority("a", 1, 1, 0, 3_000_000_000, leg.end, (leg,), None, False)
    now_ns = follow(unit, message, 0.0, 0.5, 0)
    assert not unit.twist.any()
    follow(unit, message, leg.end, 2.0, now_ns)
    assert unit.assembler.finished
    assert unit.X_WU.yaw == pytest.approx(turn, abs=0.02)


@pytest.mark.parametrize("askew_deg", [-1.7, 1.7])
def test_a_route_in_the_open_ends_within_a_degree_of_its_heading(askew_deg: float) -> None:
    """What is left of 2.9 deg, at which the base station takes a place as missed, is for how it sees tags."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(0.0, 0.0, math.radians(askew_deg)), ("b", "c", "d"))
    leg = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), 0.001, 0.0001)
    message = Authority("a", 1, 1, 0, 3_000_000_000, leg.end, (leg,), None, False)
    follow(unit, message, leg.end, 3.0, 0)
    assert unit.assembler.finished
    assert unit.X_WU.yaw == pytest.approx(0.001, abs=math.radians(1.0))


def test_it_drives_backwards_as_far_as_granted() -> None:
    yaw = 0.7
    unit = Fleet(STARTS, Mission())._unit("a", SE2(0.0, 0.0, yaw), ("b", "c", "d"))
    leg = RouteLeg(LegKind.REVERSE, (0.0, 0.0, yaw), (), (), 0.0, 0.3)
    turn = RouteLeg(LegKind.TURN, (-0.3 * math.cos(yaw), -0.3 * math.sin(yaw), yaw), (), (), 0.5, 0.35)
    message = Authority("a", 1, 1, 0, 3_000_000_000, turn.end, (leg, turn), None, False)
    now_ns = follow(unit, message, 0.12, 8.0, 0)
    back = SE2(0.0, 0.0, yaw).inverse() @ unit.X_WU
    assert -0.125 < back.x < -0.1
    assert abs(back.y) < 0.01
    assert unit.assembler.covered == pytest.approx(-back.x, abs=0.01)
    follow(unit, message, turn.end, 12.0, now_ns)
    assert unit.assembler.finished
    assert unit.X_WU.x == pytest.approx(turn.start[0], abs=0.02)
    assert unit.X_WU.y == pytest.approx(turn.start[1], abs=0.02)
    assert unit.X_WU.yaw == pytest.approx(yaw + 0.5, abs=0.05)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
def test_the_unit_rests_where_its_authority_ends_and_goes_on(
    granted: tuple[Unit, Authority], share: float
) -> None:
    unit, message = granted
    track = track_of(message.legs, unit.X_WU, Body.of(GEOMETRY).offset)
    limit = share * message.legs[-2].end
    now_ns = follow(unit, message, limit, 25.0, 0)
    assert np.abs(unit.twist).max() < 0.01
    wanted = track.at(limit)
    assert math.hypot(unit.X_WU.x - wanted.x, unit.X_WU.y - wanted.y) < 0.03
    assert limit - 0.03 < unit.assembler.covered < limit + 0.005
    follow(unit, message, message.legs[-1].end, 25.0, now_ns)
    assert unit.docking_s is not None, unit.assembler._reason
    end = SE2(*message.legs[-1].start)
    assert math.hypot(unit.X_WU.x - end.x, unit.X_WU.y - end.y) < 0.05


def test_a_unit_that_waits_has_come_as_far_as_it_may_and_stands_still(
    granted: tuple[Unit, Authority],
) -> None:
    """Others count on the whole way: one that stopped a centimetre short kept them, and itself, waiting."""
    unit, message = granted
    limit = 0.5 * message.legs[-2].end
    now_ns = follow(unit, message, limit, 25.0, 0)
    assert unit.assembler.covered > limit - 0.002
    before, rng = unit.X_WU, np.random.default_rng(4)
    for _ in range(250):
        if now_ns % 200_000_000 == 0:
            renewed = replace(
                message, seq=message.seq + now_ns, limit=limit, expires_ns=now_ns + 3_000_000_000
            )
            unit.assembler.receive(renewed)
        now_ns += DT_NS
        arena = arena_of(unit, now_ns)
        x, y, yaw = rng.normal(0.0, (0.001, 0.001, 0.003))
        own = replace(arena.own, X_WB=SE2(before.x + x, before.y + y, before.yaw + yaw))
        unit.step(now_ns, replace(arena, own=own))
    assert math.hypot(unit.X_WU.x - before.x, unit.X_WU.y - before.y) < 1e-4


@pytest.mark.parametrize("passes", [0.0, 0.05, 0.3])
def test_a_unit_that_the_collision_monitor_holds_or_slows_stays_on_its_path(passes: float) -> None:
    """Beside its path others drive and stand: a law that goes on alone leads it straight through a bend."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(), ("b", "c", "d"))
    bend = Path(np.zeros(3), np.array([0.0, 2.5, 0.0]), np.array([0.5, 0.8, 0.6]))
    end = float(bend.length) - unit.assembler._setup.offset
    leg = RouteLeg(LegKind.PATH, (0.0, 0.0, 0.0), (0.0, 2.5, 0.0), (0.5, 0.8, 0.6), 0.0, end)
    message = Authority("a", 1, 1, 0, 3_000_000_000, end, (leg,), None, False)
    points = bend.at(np.linspace(0.0, end + unit.assembler._setup.offset, 1000)).point
    now_ns, most_off = 0, 0.0
    for k in range(60):
        unit.passes = passes if k % 4 >= 2 else 1.0
        now_ns = follow(unit, message, end, 1.0, now_ns)
        tip = unit.X_WU.act([unit.assembler._setup.offset, 0.0])
        most_off = max(most_off, float(np.hypot(*(points - tip).T).min()))
    assert unit.assembler.finished
    assert most_off < 0.015


@pytest.mark.parametrize("name", ["c1", "c2"])
def test_a_unit_that_is_held_before_the_end_of_a_leg_has_not_covered_it(name: str) -> None:
    """After a while it counted as at rest there, and others were let onto ground that it needed."""
    setup = replace(setup_of("a", ("b",)), target=None, X_TD=None)
    unit = Unit("a", SE2(), build_guided(Choice(name=name), setup, REACTION_S))
    ahead = RouteLeg(LegKind.PATH, (0.0, 0.0, 0.0), (0.0,), (1.2,), 0.0, 1.2 - setup.offset)
    turn = RouteLeg(LegKind.TURN, (ahead.end, 0.0, 0.0), (), (), 1.0, ahead.end + setup.offset)
    message = Authority("a", 1, 1, 0, 3_000_000_000, turn.end, (ahead, turn), None, False)
    now_ns = 0
    while unit.X_WU.x < ahead.end - 0.06:
        now_ns = follow(unit, message, turn.end, 0.1, now_ns)
    unit.passes = 0.0
    for _ in range(60):
        now_ns = follow(unit, message, turn.end, 1.0, now_ns)
        assert unit.assembler.covered < unit.X_WU.x + 0.005
    assert unit.X_WU.yaw == pytest.approx(0.0, abs=0.05)
    unit.passes = 1.0
    follow(unit, message, turn.end, 20.0, now_ns)
    assert unit.assembler.finished
    assert ahead.end - 0.02 < unit.X_WU.x < ahead.end + 0.01


@pytest.mark.parametrize("name", ["c1", "c2"])
def test_beside_an_obstacle_it_stays_on_the_ground_that_was_granted(name: str) -> None:
    """The potential of c2 pushed it 90 mm off its route, towards a unit that stood beside that."""
    setup = replace(setup_of("a", ("b",)), target=None, X_TD=None)
    unit = Unit("a", SE2(-1.0, 0.0, 0.0), build_guided(Choice(name=name), setup, REACTION_S))
    leg = RouteLeg(LegKind.PATH, (-1.0, 0.0, 0.0), (0.0,), (2.0,), 0.0, 1.9)
    message = Authority("a", 1, 1, 0, 3_000_000_000, leg.end, (leg,), None, False)
    post, now_ns, most_off = SE2(0.0, 0.24, 0.0), 0, 0.0
    while not unit.assembler.finished:
        if now_ns % 200_000_000 == 0:
            unit.assembler.receive(replace(message, seq=2 + now_ns, expires_ns=now_ns + 3_000_000_000))
        now_ns += DT_NS
        assert now_ns < 30e9
        obstacles = (ObstacleEstimate("post", now_ns, post, 1e-6 * np.eye(3), 0.08),)
        unit.step(now_ns, replace(arena_of(unit, now_ns), obstacles=obstacles))
        most_off = max(most_off, abs(unit.X_WU.y))
    assert most_off < 0.002


@pytest.mark.parametrize("turn", [-1.0, 1.0])
def test_at_the_end_of_a_route_in_the_open_it_turns_to_the_heading_in_which_that_ends(
    turn: float,
) -> None:
    """The route ends in a bend, out of which the law comes in askew; only then the whole way is reported."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(), ("b", "c", "d"))
    lengths, curvature = (0.3, 0.9), (0.0, 2.5 * turn)
    end = sum(lengths) - unit.assembler._setup.offset
    leg = RouteLeg(LegKind.PATH, (0.0, 0.0, 0.0), curvature, lengths, 0.0, end)
    message = Authority("a", 1, 1, 0, 3_000_000_000, end, (leg,), None, False)
    now_ns, askew = 0, []
    while not unit.assembler.finished:
        assert unit.assembler.covered < end - SAME_M
        now_ns = follow(unit, message, end, 0.1, now_ns)
        assert now_ns < 30e9
        if unit.assembler.progress is not None and unit.assembler.progress.stage == "turn":
            askew.append(abs(wrap_angle(2.25 * turn - unit.X_WU.yaw)))
    assert max(askew) > math.radians(4.0)
    assert abs(wrap_angle(2.25 * turn - unit.X_WU.yaw)) < math.radians(2.5)
    assert unit.assembler.covered == end


def test_the_dock_leg_is_entered_whole_or_not_at_all(granted: tuple[Unit, Authority]) -> None:
    unit, message = granted
    follow(unit, message, message.legs[-1].end - 0.05, 40.0, 0)
    assert unit.docking_s is None
    assert unit.assembler.covered == pytest.approx(message.legs[-2].end, abs=0.01)


def test_an_authority_that_is_not_renewed_brakes_the_unit(granted: tuple[Unit, Authority]) -> None:
    """It expires after three seconds; the unit stands within its braking distance, and goes on when heard."""
    unit, message = granted
    end = message.legs[-1].end
    now_ns = follow(unit, message, end, 3.0, 0, renew=False)
    before, speed = unit.assembler.covered, float(abs(unit.twist[0]))
    now_ns = follow_silent(unit, 5.0, now_ns)
    assert np.abs(unit.twist).max() < 0.01
    assert (
        unit.assembler.covered - before < unit.assembler.authority.stopping_distance(max(speed, 0.25)) + 0.03
    )
    follow(unit, message, end, 40.0, now_ns)
    assert unit.docking_s is not None


def follow_silent(unit: Unit, seconds: float, now_ns: int) -> int:
    for _ in range(round(1e9 * seconds / DT_NS)):
        now_ns += DT_NS
        unit.step(now_ns, arena_of(unit, now_ns))
    return now_ns


def test_a_unit_that_is_not_seen_stands_and_gives_up(granted: tuple[Unit, Authority]) -> None:
    """Whenever that is in a mission, and for no longer than it was told to wait."""
    unit, message = granted
    unit.assembler.receive(message)
    begin_ns, lost_ns = 100_000_000_000, round(1e9 * unit.assembler.params.watch.lost_s)
    for now_ns in range(begin_ns, begin_ns + lost_ns + DT_NS, DT_NS):
        unit.step(now_ns, None)
        assert not unit.twist.any()
        assert unit.gave_up is None
    unit.step(now_ns + DT_NS, None)
    assert unit.gave_up is not None
    assert unit.gave_up.failure is FailureReason.NOT_LOCALISED


@pytest.mark.parametrize("turn", [-0.5, 0.5])
def test_it_drives_backwards_after_a_turn(turn: float) -> None:
    """As far as granted, counted from where that leg begins."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(), ("b", "c", "d"))
    first = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), turn, 0.05)
    back = RouteLeg(LegKind.REVERSE, (0.0, 0.0, turn), (), (), 0.0, 0.25)
    last = RouteLeg(LegKind.TURN, (-0.2 * math.cos(turn), -0.2 * math.sin(turn), turn), (), (), turn, 0.3)
    message = Authority("a", 1, 1, 0, 3_000_000_000, last.end, (first, back, last), None, False)
    follow(unit, message, 0.15, 6.0, 0)
    assert -(SE2(0.0, 0.0, turn).inverse() @ unit.X_WU).x == pytest.approx(0.1, abs=0.02)
    assert unit.assembler.covered == pytest.approx(0.15, abs=0.02)


@pytest.mark.parametrize("turn", [-0.5, 0.5])
def test_a_leg_begins_only_when_the_unit_has_come_to_rest_from_its_turn(turn: float) -> None:
    """At either end of a turn, to either side: the path that follows begins where the turn was to end."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(0.0, 0.0, turn), ("b", "c", "d"))
    leg = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), turn, 0.05)
    path = RouteLeg(LegKind.PATH, (0.0, 0.0, turn), (0.0,), (0.8,), 0.0, 0.75)
    unit.assembler.receive(Authority("a", 1, 1, 0, 3_000_000_000, path.end, (leg, path), None, False))
    stages = []
    for k, w in enumerate((0.3 * turn, 0.3 * turn, 0.0)):
        observation = Observation(k * DT_NS, twist=Twist(0.0, w), arena=arena_of(unit, k * DT_NS))
        unit.assembler.step(observation)
        assert unit.assembler.progress is not None
        stages.append(unit.assembler.progress.stage)
    assert stages == ["turn", "turn", "drive"]


def test_a_route_in_the_open_is_over_when_the_unit_faces_its_end_and_rests() -> None:
    """To either side and in either direction; from then on it stands, whatever noise says."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(), ("b", "c", "d"))
    leg = RouteLeg(LegKind.TURN, (0.0, 0.0, 0.0), (), (), 0.001, 0.0001)
    unit.assembler.receive(Authority("a", 1, 1, 0, 3_000_000_000, leg.end, (leg,), None, False))
    now_ns, still = 0, Twist()

    def ask(yaw_deg: float, twist: Twist) -> Twist:
        nonlocal now_ns
        now_ns += DT_NS
        unit.X_WU = SE2(0.0, 0.0, math.radians(yaw_deg))
        decision = unit.assembler.step(Observation(now_ns, twist=twist, arena=arena_of(unit, now_ns)))
        assert isinstance(decision, Twist)
        return decision

    for yaw_deg in (1.5, -1.5):
        assert ask(yaw_deg, still).w * yaw_deg < 0.0
        assert not unit.assembler.finished
    for twist in (Twist(0.05), Twist(-0.05), Twist(0.0, 0.1), Twist(0.0, -0.1)):
        ask(0.0, twist)
        assert not unit.assembler.finished
    assert ask(0.0, still) == still
    assert unit.assembler.finished
    assert ask(1.5, still) == still
    assert unit.assembler.finished


def test_a_unit_that_is_seen_again_begins_from_rest() -> None:
    """It has stopped meanwhile; a law that went on from its last speed would ask for all of that at once."""
    unit = Fleet(STARTS, Mission())._unit("a", SE2(), ("b", "c", "d"))
    leg = RouteLeg(LegKind.PATH, (0.0, 0.0, 0.0), (0.0,), (2.1,), 0.0, 2.0)
    message = Authority("a", 1, 1, 0, 3_000_000_000, leg.end, (leg,), None, False)
    now_ns = follow(unit, message, leg.end, 4.0, 0)
    assert unit.passed is not None
    cruise = unit.passed.v
    assert cruise > 0.1
    for _ in range(100):
        now_ns += DT_NS
        unit.step(now_ns, None)
    assert not unit.twist.round(3).any()
    follow(unit, message, leg.end, 0.02, now_ns)
    assert 0.0 <= unit.passed.v < 0.2 * cruise
