"""A robot before a port, in a dozen lines, and what is known of the shipped unit in an arena.

The robot is a unicycle, two switches, a lock and an honest or a lying sensor. It stands in for plant and
perception where the phase machine alone is under test. The real loop is tested in ``tests/bullet``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.docking.controller import build_controller
from msrr_control.docking.law import DockSetup
from msrr_control.kinematics.drive_limits import nested_limit
from msrr_control.sequence.observation import Observation
from msrr_control.sequence.state_machine import PhaseMachine
from msrr_control.tracks.route_params import RouteParams
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.messages import (
    Action,
    LockFeedback,
    LockPosition,
    LosObservation,
    LosStatus,
    Phase,
    PoseEstimate,
    SeatSwitches,
    Twist,
)
from msrr_scenes.specs.control import DockingSpec, LosSpec
from msrr_scenes.specs.spec import Choice
from msrr_scenes.specs.vehicle import LimitsSpec

BOX = (-2.0, 2.0, -1.5, 1.5)
DT_NS = 20_000_000
SEATED_GAP = 0.0013


def make_setup(setting: str = "normal") -> DockSetup:
    limits = LimitsSpec.model_validate({"setting": setting})
    return DockSetup(
        offset=0.1,
        camera_offset=0.0,
        pin_reach=0.018,
        mouth=0.015,
        pins=(0.04, -0.04),
        los=LosSpec(),
        limits=limits,
        rate_hz=50.0,
    )


@dataclass
class ToyRobot:
    """Truth and sensors. ``blocked_until`` puts something into the holes before that attempt.

    A lock that closes on nothing reports that it is closed, and holds nothing.
    """

    X_DU: SE2 = field(default_factory=lambda: SE2(-0.8, 0.05, 0.1))
    spec: DockingSpec = field(default_factory=DockingSpec)
    controller: Choice = field(default_factory=lambda: Choice(name="c1"))
    facts: DockSetup = field(default_factory=make_setup)
    blind: bool = False
    blocked_until: int = 1
    cam_jams: bool = False
    seen_offset: float = 0.0
    rng: np.random.Generator | None = None
    now_ns: int = 0
    twist: Twist = field(default_factory=Twist)
    closing_s: float = 0.0
    seen_ns: int | None = None
    log: list[Action] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.machine = PhaseMachine(self.spec, self.facts, build_controller(self.controller, self.facts))

    @property
    def gap(self) -> float:
        return -(self.X_DU.x + self.facts.offset * math.cos(self.X_DU.yaw))

    def edges(self) -> tuple[float, float]:
        los = self.facts.los
        y, ahead = self.X_DU.y, los.setback_m - self.X_DU.x
        b = los.half_width_m
        return math.atan2(b - y, ahead) - self.X_DU.yaw, math.atan2(-b - y, ahead) - self.X_DU.yaw

    def observe(self) -> Observation:
        left, right = self.edges()
        seen = not self.blind and max(abs(left), abs(right)) < math.radians(37.5)
        if seen:
            self.seen_ns = self.now_ns
        pose, los = None, None
        if self.seen_ns is not None:
            noise = np.zeros(3) if self.rng is None else self.rng.normal(0.0, [0.001, 0.001, 0.005])
            X = SE2(
                self.X_DU.x + noise[0] + self.seen_offset, self.X_DU.y + noise[1], self.X_DU.yaw + noise[2]
            )
            pose = PoseEstimate(self.now_ns, X, np.diag([1e-6, 1e-6, 1e-5]), self.seen_ns)
            status = LosStatus.SEEN if seen else LosStatus.LOST
            los = LosObservation(self.now_ns, left, right, math.radians(37.5) - abs(left), status)
        seated = self.gap < SEATED_GAP + 5e-4
        return Observation(
            now_ns=self.now_ns,
            pose=pose,
            los=los,
            switches=SeatSwitches("a", self.now_ns, seated, seated),
            lock=LockFeedback("a", self.now_ns, self.lock_position()),
            twist=self.twist,
        )

    def lock_position(self) -> LockPosition:
        if self.closing_s <= 0.0:
            return LockPosition.OPEN
        closed = self.closing_s >= 0.5 and not self.cam_jams
        return LockPosition.CLOSED if closed else LockPosition.CLOSING

    def step(self) -> Action:
        action = self.machine.step(self.observe())
        self.log.append(action)
        dt, limits = 1e-9 * DT_NS, self.facts.limits
        self.closing_s = min(self.closing_s + dt, 1.0) if action.lock else 0.0
        self.twist = Twist(
            nested_limit(
                self.twist.v, action.twist.v, limits.v_max_mps, limits.a_max_mps2, limits.kappa_per_s, dt
            ),
            nested_limit(
                self.twist.w, action.twist.w, limits.w_max_radps, limits.dw_max_radps2, limits.kappa_per_s, dt
            ),
        )
        moved = self.X_DU @ SE2.exp(dt * self.twist.v, 0.0, dt * self.twist.w)
        floor = SEATED_GAP if action.attempt >= self.blocked_until else 0.010
        gap = -(moved.x + self.facts.offset * math.cos(moved.yaw))
        if self.lock_position() is not LockPosition.CLOSED or self.gap > SEATED_GAP + 0.0025:
            self.X_DU = SE2(moved.x - max(floor - gap, 0.0), moved.y, moved.yaw)
        self.now_ns += DT_NS
        return action

    def run(self, seconds: float = 90.0) -> Action:
        action = self.step()
        while not self.machine.finished and self.now_ns < 1e9 * seconds:
            action = self.step()
        return action

    def phases(self) -> list[Phase]:
        """The phases gone through, each once per visit."""
        return [a.phase for i, a in enumerate(self.log) if i == 0 or self.log[i - 1].phase is not a.phase]


@pytest.fixture
def facts() -> DockSetup:
    """The unit of the design under NORMAL limits."""
    return make_setup()


@pytest.fixture
def tight() -> DockSetup:
    """The same under TIGHT limits."""
    return make_setup("tight")


@pytest.fixture
def toy() -> type[ToyRobot]:
    """The toy robot's class."""
    return ToyRobot


def random_starts(seed: int, count: int, box: tuple[float, float, float, float] = BOX) -> dict[str, SE2]:
    """Poses all over the arena, 0.45 m and more apart."""
    rng = np.random.default_rng(seed)
    x0, x1, y0, y1 = box
    starts: dict[str, SE2] = {}
    while len(starts) < count:
        X = SE2(*rng.uniform([x0 + 0.25, y0 + 0.25, -math.pi], [x1 - 0.25, y1 - 0.25, math.pi]))
        if all(math.hypot(X.x - o.x, X.y - o.y) > 0.45 for o in starts.values()):
            starts[f"u{len(starts)}"] = X
    return starts


@pytest.fixture(scope="session")
def setup() -> CoordinationSetup:
    """The shipped unit in an arena of 4 m by 3 m."""
    return CoordinationSetup.of(read_unit(find_urdf("unit.urdf")), RouteParams(), BOX)


@pytest.fixture(scope="session")
def starts() -> Callable[..., dict[str, SE2]]:
    """The function that draws poses all over the arena."""
    return random_starts
