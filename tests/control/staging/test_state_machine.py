"""The long-distance phase in closed loop: an ideal unit, noisy localisation, and what may get in its way."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np
import pytest

from msrr_control.kinematics.drive_limits import nested_limit_twist
from msrr_control.kinematics.unicycle import advance_pose
from msrr_control.sequence.observation import GiveUp, Observation
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.registry import build_assembler
from msrr_control.staging.setup import AssemblySetup
from msrr_control.staging.state_machine import AssemblyState, LongDistanceAssembler
from msrr_control.studies import metrics
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    ArenaEstimate,
    AssemblyProgress,
    FailureReason,
    GlobalPose,
    ObstacleEstimate,
    Twist,
)
from msrr_scenes.specs.bodies import ArenaSpec
from msrr_scenes.specs.spec import Choice
from msrr_scenes.specs.vehicle import LimitsSpec

DT_NS = 20_000_000
CERTAIN = 1e-6 * np.eye(3)
HALF = 0.1  # the unit is a square


def make_setup(
    limits: str = "normal", half: float = HALF, offset: float = 0.1, **obstacles: float
) -> AssemblySetup:
    return AssemblySetup(
        unit="a",
        target="b",
        offset=offset,
        half_width=half,
        X_TD=SE2(-0.1, 0.0, 0.0),
        unit_radius={"a": max(0.128, math.hypot(half, offset)), "b": 0.128, "c": 0.128},
        obstacle_radius=obstacles,
        arena=ArenaSpec(),
        in_view=None,
        limits=LimitsSpec.model_validate({"setting": limits}),
        rate_hz=50.0,
        sigmas=2.0,
        approach_m=0.45,
    )


@dataclass
class Arena:
    """One unit on its way; obstacles are (x, y, radius, time at which they appear)."""

    X_WU: SE2
    X_WT: SE2 = field(default_factory=lambda: SE2(1.2, 0.0, 0.0))
    obstacles: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    others: dict[str, SE2] = field(default_factory=dict)
    limits: str = "normal"
    params: dict[str, object] = field(default_factory=dict)
    seed: int | None = 0
    hidden: tuple[float, float] = (math.inf, math.inf)
    held: tuple[float, float] = (math.inf, math.inf)
    monitored: bool = False
    half: float = HALF
    offset: float = 0.1

    def __post_init__(self) -> None:
        self.setup = make_setup(self.limits, self.half, self.offset)
        built = build_assembler(Choice(name="c1", params=self.params), self.setup)
        assert isinstance(built, LongDistanceAssembler)
        self.assembler = built
        self.rng = None if self.seed is None else np.random.default_rng(self.seed)
        self.twist, self.now_ns, self.seen_ns = np.zeros(2), 0, -1
        self.outcome: GiveUp | None = None
        self.arrived = False
        self.gap = math.inf
        self.log: list[AssemblyProgress] = []

    def _seen(self, X: SE2, sigma_m: float, sigma_deg: float) -> SE2:
        if self.rng is None:
            return X
        n = self.rng.standard_normal(3)
        return SE2(X.x + sigma_m * n[0], X.y + sigma_m * n[1], X.yaw + math.radians(sigma_deg) * n[2])

    def standing(self) -> dict[str, tuple[float, float, float]]:
        now = 1e-9 * self.now_ns
        return {name: (x, y, r) for name, (x, y, r, at) in self.obstacles.items() if at <= now}

    def arena_estimate(self) -> ArenaEstimate | None:
        now = self.now_ns
        if not self.hidden[0] <= 1e-9 * now < self.hidden[1]:
            self.seen_ns = now
        if self.seen_ns < 0:
            return None
        return ArenaEstimate(
            stamp_ns=now,
            own=GlobalPose("a", now, self._seen(self.X_WU, 0.004, 0.5), CERTAIN),
            target=GlobalPose("b", now, self._seen(self.X_WT, 0.002, 0.2), CERTAIN),
            others=tuple(GlobalPose(n, now, X, CERTAIN) for n, X in self.others.items()),
            obstacles=tuple(
                ObstacleEstimate(name, now, self._seen(SE2(x, y), 0.003, 0.0), CERTAIN, r)
                for name, (x, y, r) in self.standing().items()
            ),
            last_seen_ns=self.seen_ns,
        )

    def step(self) -> None:
        decision = self.assembler.step(
            Observation(now_ns=self.now_ns, twist=Twist(*map(float, self.twist)), arena=self.arena_estimate())
        )
        if self.assembler.progress is not None:
            self.log.append(self.assembler.progress)
        if not isinstance(decision, Twist):
            self.outcome, self.arrived = decision, decision is None
            return
        assert abs(decision.v) <= self.setup.limits.v_max_mps
        assert abs(decision.w) <= self.setup.limits.w_max_radps
        held = self.held[0] <= 1e-9 * self.now_ns < self.held[1]
        if self.monitored:
            ahead = advance_pose(self.X_WU.as_array(), 0.1 * decision.v, 0.1 * decision.w)
            held = self._gap(SE2(*ahead)) < min(0.03, self._gap(self.X_WU) - 1e-6)
        limits = self.setup.limits
        command = np.zeros(2) if held else np.array([decision.v, decision.w])
        self.twist = nested_limit_twist(self.twist, command, limits, limits.kappa_per_s, 0.02)
        self.X_WU = SE2(*advance_pose(self.X_WU.as_array(), 0.02 * self.twist[0], 0.02 * self.twist[1]))
        self.now_ns += DT_NS
        self.gap = min(self.gap, self._gap(self.X_WU))

    def _gap(self, X_WU: SE2) -> float:
        """Smallest distance of the unit at a pose to what stands [m]."""
        bodies = [*self.standing().values(), *((X.x, X.y, 0.128) for X in (self.X_WT, *self.others.values()))]
        gap = math.inf
        for x, y, r in bodies:
            ahead, left = X_WU.inverse().act([x, y])
            beside = max(abs(ahead) - self.offset, 0), max(abs(left) - self.half, 0)
            gap = min(gap, math.hypot(*beside) - r)
        return gap

    def run(self, seconds: float = 90.0) -> Arena:
        while not self.arrived and self.outcome is None and self.now_ns < 1e9 * seconds:
            self.step()
        return self

    def reasons(self) -> list[str]:
        return [p.reason for i, p in enumerate(self.log) if i == 0 or self.log[i - 1].reason != p.reason]

    def error(self) -> tuple[float, float, float]:
        """Of the controlled point and the heading at the hand-over [m, m, deg]."""
        X = (self.X_WT @ self.setup.X_TD).inverse() @ self.X_WU
        tip = X.act([self.offset, 0.0])
        return tip[0] + 0.7, tip[1], math.degrees(X.yaw)

    def stands_before_the_port(self) -> bool:
        x, y, yaw = self.error()
        return (
            self.arrived and abs(x) < 0.02 and abs(y) < 0.02 and abs(yaw) < 6.0 and abs(self.twist[0]) < 0.03
        )


@pytest.mark.parametrize("limits", ["normal", "tight"])
@pytest.mark.parametrize("seed", [1, 2])
def test_it_comes_from_anywhere(seed: int, limits: str) -> None:
    rng = np.random.default_rng(seed)
    for i in range(2):
        arena = Arena(SE2(*rng.uniform([-1.7, -1.2, -3.1], [0.2, 1.2, 3.1])), limits=limits, seed=i).run()
        assert arena.stands_before_the_port(), (arena.error(), arena.reasons())
        assert arena.gap > 0.3


@pytest.fixture(scope="module")
def past_an_obstacle() -> Arena:
    return Arena(SE2(-1.7, 0.3, 0.0), obstacles={"o": (-0.75, 0.09, 0.08, 0.0)}).run()


def test_past_an_obstacle_on_the_path(past_an_obstacle: Arena) -> None:
    arena = past_an_obstacle
    assert arena.stands_before_the_port()
    assert arena.gap > 0.04
    assert {p.avoiding for p in arena.log} == {None, "o"}
    driven = [p for p in arena.log if p.stage in ("drive", "settle")]
    time = np.array([1e-9 * p.stamp_ns for p in driven])
    off = metrics.deviation(np.array([p.tip for p in driven]), np.array([p.desired for p in driven]))
    episode = metrics.obstacle_episode(time, off, np.array([p.avoiding is not None for p in driven]))
    assert 0.1 < metrics.amplitude(off, episode) < 0.30
    assert metrics.recovery_time(time, off, episode) < 3.0
    assert arena.assembler.path is not None
    assert arena.assembler.path.number == 1


def test_two_obstacles_and_another_unit() -> None:
    arena = Arena(
        SE2(-1.7, -0.6, 1.0),
        obstacles={"o": (-0.9, -0.4, 0.08, 0.0), "p": (-0.3, 0.35, 0.08, 0.0)},
        others={"c": SE2(-0.2, -0.5, 0.4)},
    ).run()
    assert arena.stands_before_the_port()
    assert arena.gap > 0.04


@pytest.mark.parametrize("at", [2.0, 4.5])
def test_an_obstacle_that_appears_is_found_and_avoided(at: float) -> None:
    arena = Arena(SE2(-1.7, 0.2, 0.0), obstacles={"late": (-0.2, 0.05, 0.08, at)}).run()
    assert arena.stands_before_the_port()
    assert arena.gap > 0.04
    assert any("late appeared on the path" in r for r in arena.reasons())


@pytest.mark.parametrize("late", [False, True])
def test_where_there_is_no_way_it_gives_up_at_rest(late: bool) -> None:
    at = 4.0 if late else 0.0
    fence = {f"f{k}": (-0.1, y, 0.2, at) for k, y in enumerate(np.linspace(-1.2, 1.2, 5))}
    arena = Arena(SE2(-1.5, 0.3, 0.0), obstacles=fence).run()
    assert arena.outcome is not None
    assert arena.outcome.failure is FailureReason.BLOCKED
    assert "no way to the port" in arena.outcome.reason
    assert abs(arena.twist[0]) < 0.01
    assert arena.gap > 0.1
    assert arena.now_ns < 30e9


def test_it_says_what_stands_on_its_place() -> None:
    arena = Arena(SE2(-1.5, 0.3, 0.0), obstacles={"crate": (0.35, 0.0, 0.1, 0.0)}).run()
    assert arena.outcome is not None
    assert "crate stands on the place in front of the port" in arena.outcome.reason


def test_it_waits_while_it_is_not_seen_and_goes_on() -> None:
    arena = Arena(SE2(-1.5, 0.3, 0.0), hidden=(4.0, 8.0))
    while arena.now_ns < 7.5e9:
        arena.step()
    assert np.abs(arena.twist).max() < 1e-3
    assert arena.run().stands_before_the_port()
    assert arena.assembler.path is not None
    assert arena.assembler.path.number == 1


@pytest.mark.parametrize("hidden_s", [1.77, 1.82, 1.87])
def test_a_turn_in_which_it_was_not_seen_was_not_stopped(hidden_s: float) -> None:
    """It is hidden near the end of the turn, stands for 7 s, and goes on with the turn."""
    arena = Arena(SE2(-1.0, 0.3, 2.0), hidden=(hidden_s, hidden_s + 8.0)).run()
    assert arena.stands_before_the_port()
    assert arena.assembler.path is not None
    assert (arena.assembler.path.number, arena.assembler.path.shape) == (1, "arc")


def test_time_in_which_it_is_not_seen_is_no_time_without_a_route() -> None:
    """A crate stands in the lane; it is carried away 2 s after the unit is seen again."""
    crate = {"crate": (0.7, 0.0, 0.1, 0.0)}
    arena = Arena(SE2(-1.0, 0.3, 0.0), obstacles=crate, hidden=(0.3, 7.3))
    while arena.now_ns < 9.3e9:
        assert arena.outcome is None
        arena.step()
    arena.obstacles.clear()
    assert arena.run().stands_before_the_port()


def test_a_unit_that_is_never_seen_shows_itself_and_gives_up() -> None:
    arena = Arena(SE2(-1.5, 0.3, 0.0), hidden=(0.0, math.inf))
    while arena.now_ns < 5e9:
        arena.step()
    assert arena.twist[1] == pytest.approx(AssemblyParams().watch.spin_radps, abs=0.01)
    assert arena.twist[0] == 0.0
    arena.run()
    assert arena.outcome is not None
    assert arena.outcome.failure is FailureReason.NOT_LOCALISED
    assert arena.outcome.reason.endswith(" s: the unit, or its target, was never seen from above")


def test_one_that_is_lost_on_the_way_says_since_when() -> None:
    arena = Arena(SE2(-1.5, 0.3, 0.0), hidden=(4.0, math.inf)).run()
    assert arena.outcome is not None
    reason = arena.outcome.reason
    assert re.search(r"^not localised for 10\.\d s: last seen from above 1\d\.\d s ago$", reason)


def test_a_unit_that_is_held_waits_and_then_plans_again() -> None:
    """Somebody else stops it for ten seconds: no wind-up, another path, and it arrives."""
    arena = Arena(SE2(-1.5, 0.3, 0.0), held=(4.0, 14.0)).run()
    assert any("no progress" in r for r in arena.reasons())
    assert arena.stands_before_the_port()


def test_a_unit_that_is_held_for_good_gives_up() -> None:
    arena = Arena(SE2(-1.5, 0.3, 0.0), held=(4.0, math.inf)).run(seconds=200.0)
    assert arena.outcome is not None
    assert arena.outcome.failure is FailureReason.BLOCKED
    assert "paths" in arena.outcome.reason


def test_a_target_that_moves_is_followed() -> None:
    arena = Arena(SE2(-1.5, 0.3, 0.0))
    while arena.now_ns < 4e9:
        arena.step()
    arena.X_WT = SE2(1.25, 0.2, 0.2)
    assert arena.run().stands_before_the_port()
    assert any("elsewhere" in r for r in arena.reasons())


def test_it_is_there_at_once_but_comes_again_after_a_failed_hand_over() -> None:
    arena = Arena(SE2(0.3, 0.0, 0.0), seed=None)
    arena.step()
    assert arena.arrived
    arena.arrived = False
    arena.assembler.reset("target not found")
    farthest = 0.3
    while not arena.arrived and arena.now_ns < 60e9:
        arena.step()
        farthest = min(farthest, arena.X_WU.x)
    assert arena.stands_before_the_port()
    assert farthest < 0.12
    assert "target not found" in arena.reasons()[1]


@pytest.mark.parametrize(("aside_m", "astray"), [(0.35, False), (0.60, True)])
def test_a_unit_that_is_carried_off_its_path_takes_another(aside_m: float, astray: bool) -> None:
    """Lifted to the side: from near the path the law draws it back, from farther away it plans again."""
    arena = Arena(SE2(-1.5, 0.3, 0.0))
    while arena.now_ns < 4e9:
        arena.step()
    assert arena.assembler.progress is not None
    assert arena.assembler.progress.stage == AssemblyState.DRIVE.value
    arena.X_WU = arena.X_WU @ SE2(0.0, aside_m, 0.0)
    assert arena.run().stands_before_the_port()
    off = [r for r in arena.reasons() if "off the path" in r]
    assert bool(off) is astray
    if astray:
        assert float(off[0].split()[0]) == pytest.approx(aside_m, abs=0.1)
    assert arena.assembler.path is not None
    assert arena.assembler.path.number == (2 if astray else 1)


@pytest.mark.parametrize(
    ("yaw", "held", "says"),
    [(2.0, (0.0, 12.0), "could not turn on the spot"), (0.0, (2.0, 9.0), "no progress")],
)
def test_a_unit_that_was_stopped_drives_around_instead_of_along_walls(
    yaw: float, held: tuple[float, float], says: str
) -> None:
    """Its first path left the obstacle to a wall; it does not know what stopped it, and keeps away more."""
    arena = Arena(SE2(-1.7, 0.3, yaw), obstacles={"o": (-0.5, 0.09, 0.08, 0.0)}, held=held)
    shapes = {}
    while not arena.arrived and arena.outcome is None:
        arena.step()
        path = arena.assembler.path
        if path is not None:
            shapes.setdefault(path.number, path.shape)
    assert any(says in reason for reason in arena.reasons())
    assert shapes[1] == "arc"
    assert shapes[2] != "arc"
    assert arena.stands_before_the_port()


@pytest.mark.parametrize(
    ("held", "shape", "gap"), [((math.inf, math.inf), "arc", 0.042), ((0.5, 7.5), "around", 0.09)]
)
@pytest.mark.parametrize("y", [0.0, 0.1, 0.2])
def test_a_large_unit_keeps_its_distance_while_its_axle_trails(
    y: float, held: tuple[float, float], shape: str, gap: float
) -> None:
    """0.5 m long and 0.3 m wide: along a wall, and around the obstacle after something has held it.

    If it left the wall, or drove around, as a unit with l = 0.1 m does, it would come 7 and 30 mm nearer.
    """
    X_WU, post = SE2(-1.7, y, 0.0), (-0.9, 0.05, 0.08, 0.0)
    arena = Arena(X_WU, obstacles={"o": post}, half=0.15, offset=0.25, held=held).run()
    assert arena.arrived, arena.reasons()
    assert arena.assembler.path is not None
    assert arena.assembler.path.shape == shape
    assert arena.gap > gap


@pytest.mark.parametrize("along", [0.03, 0.05, 0.08])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_unit_without_room_to_turn_drives_straight_first(side: float, along: float) -> None:
    """A post stands 35 mm beside the body: the monitor stops a turn, in which a corner would touch it."""
    X_WU = SE2(-1.0, 0.0, math.radians(90.0 * side))
    x, y = X_WU.act([along, -side * 0.215])
    arena = Arena(X_WU, obstacles={"o": (float(x), float(y), 0.08, 0.0)}, monitored=True).run()
    assert any("could not turn on the spot" in reason for reason in arena.reasons())
    assert "clear" in {p.stage for p in arena.log}
    assert arena.stands_before_the_port(), arena.reasons()
    assert arena.gap > 0.02


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("aside_m", "yaw_deg", "there"),
    [(0.0, 11.5, True), (0.0, 12.5, False), (0.0, 90.0, False), (0.049, 0.0, True), (0.051, 0.0, False)],
)
@pytest.mark.parametrize(("heading", "gap_m"), [(0.0, 0.7), (1.0, 0.45), (math.pi, 0.6)])
def test_it_is_there_by_place_and_by_heading(
    heading: float, gap_m: float, side: float, aside_m: float, yaw_deg: float, there: bool
) -> None:
    """The end of the path lies 0.7 m before the port, and a failed attempt begins again 0.45 m before it."""
    watch = AssemblyParams().watch
    assert (watch.there_m, watch.there_deg) == (0.05, 12.0)
    X_WV = SE2(0.0, 0.0, heading)
    X_VU = SE2(1.1 - gap_m, side * aside_m, side * math.radians(yaw_deg)) @ SE2(-0.1, 0.0, 0.0)
    arena = Arena(X_WV @ X_VU, X_WV @ SE2(1.2, 0.0, 0.0), seed=None)
    arena.step()
    assert arena.arrived is there


@pytest.mark.parametrize(("gap_m", "there"), [(0.749, True), (0.751, False), (0.401, True), (0.399, False)])
def test_it_is_there_neither_too_far_from_the_port_nor_too_near(gap_m: float, there: bool) -> None:
    arena = Arena(SE2(1.0 - gap_m, 0.0, 0.0), seed=None)
    arena.step()
    assert arena.arrived is there


def test_the_envelope_can_be_switched_off() -> None:
    arena = Arena(
        SE2(-1.7, 0.3, 0.0), obstacles={"o": (-0.75, 0.09, 0.08, 0.0)}, params={"envelope": False}
    ).run()
    assert arena.gap < 0.0


def test_the_same_observations_give_the_same_bits(past_an_obstacle: Arena) -> None:
    again = Arena(SE2(-1.7, 0.3, 0.0), obstacles={"o": (-0.75, 0.09, 0.08, 0.0)}).run()
    assert again.X_WU == past_an_obstacle.X_WU


def _ask(arena: Arena, twist: Twist) -> str:
    """Let 20 ms go by, in which the unit moves by nothing, and return what it does next."""
    arena.twist = np.array([twist.v, twist.w])
    arena.now_ns += DT_NS
    observation = Observation(now_ns=arena.now_ns, twist=twist, arena=arena.arena_estimate())
    arena.assembler.step(observation)
    assert arena.assembler.progress is not None
    return arena.assembler.progress.stage


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("v", "w"), [(0.03, 0.0), (0.0, 0.1)])
def test_it_plans_once_it_stands_or_has_had_its_time_to_come_to_rest(sign: float, v: float, w: float) -> None:
    """Encoders that always tell of some motion keep no unit from its way."""
    moving = Arena(SE2(-1.0, 0.3, 2.0), seed=None)
    stages = [_ask(moving, Twist(sign * v, sign * w)) for _ in range(80)]
    assert stages[:75] == ["brake"] * 75
    assert stages[-1] == "turn"
    assert _ask(Arena(SE2(-1.0, 0.3, 2.0), seed=None), Twist(0.5 * sign * v, 0.5 * sign * w)) == "turn"


@pytest.mark.parametrize(("off_deg", "turns"), [(10.0, False), (-10.0, False), (14.0, True), (-14.0, True)])
def test_it_turns_on_the_spot_only_where_the_path_begins_in_another_direction(
    off_deg: float, turns: bool
) -> None:
    """And then until it is better aligned than one that need not turn."""
    arena = Arena(SE2(-1.2, 0.0, math.radians(off_deg)), seed=None)
    assert (_ask(arena, Twist()) == "turn") is turns
    arena.X_WU = SE2(-1.2, 0.0, math.copysign(math.radians(5.0), off_deg))
    assert (_ask(arena, Twist()) == "turn") is turns
    arena.X_WU = SE2(-1.2, 0.0, math.copysign(math.radians(1.0), off_deg))
    assert _ask(arena, Twist()) == "drive"


@pytest.mark.parametrize("yaw", [-2.0, 2.0])
def test_a_turn_on_the_spot_that_gets_nowhere_ends(yaw: float) -> None:
    """To either side, with another path from there; one that comes on goes on, however slowly."""
    watch = AssemblyParams().watch
    held, slow = (Arena(SE2(-1.2, 0.0, yaw), seed=None) for _ in range(2))
    numbers = []
    for _ in range(round(50.0 * watch.stuck_s) + 3):
        _ask(held, Twist())
        assert held.assembler.path is not None
        numbers.append(held.assembler.path.number)
    assert numbers[:-2] == [1] * len(numbers[:-2])
    assert numbers[-1] == 2
    assert "could not turn on the spot" in held.assembler.path.reason
    for _ in range(round(100.0 * watch.stuck_s)):
        slow.X_WU = SE2(-1.2, 0.0, slow.X_WU.yaw - math.copysign(0.02 * 0.1, yaw))
        assert _ask(slow, Twist()) == "turn"
    assert slow.assembler.path is not None
    assert slow.assembler.path.number == 1
