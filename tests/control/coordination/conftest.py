"""A kinematic rig: units that follow their tracks exactly, a radio that loses messages, a judge of truth.

It stands in for robots and physics where coordination alone is under test. Units know what they were sent,
the coordinator knows what it saw and heard, and the judge compares the bodies themselves at every step.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pytest

from msrr_control.coordination.coordinator import Coordinator
from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.bodies import Body
from msrr_control.shapes.reconfiguration import assembly_ports, shape_ports
from msrr_control.shapes.shape import Shape
from msrr_control.tracks.authority import MovementAuthority
from msrr_control.tracks.track import Track, track_of
from msrr_scenes.arrays import frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, ObstacleEstimate
from msrr_scenes.messages.coordination import (
    Authority,
    LegKind,
    MissionState,
    MissionStatus,
    UnitMode,
    UnitReport,
    UnitState,
)
from msrr_scenes.specs.mission import RadioSpec
from msrr_scenes.specs.vehicle import LimitsSpec

TICK_NS = 50_000_000
BASE_NS = 100_000_000  # between two steps of the base station, as in a trial
LIMITS = LimitsSpec.model_validate({})
SPEED = {
    LegKind.BACK: 0.10,
    LegKind.REVERSE: 0.10,
    LegKind.TURN: 0.08,
    LegKind.PATH: 0.22,
    LegKind.DOCK: 0.11,
}
ACCELERATION, DECELERATION = 0.147, 0.8 * LIMITS.a_max_mps2
LOCK_S, UNLOCK_S, SEIZED_S, UNSEEN_S = 2.0, 1.0, 5.0, 10.0
RETREAT_M = 0.5
COVARIANCE = frozen(np.eye(3) * 1e-6)
CAMERA_NS = 100_000_000


@dataclass
class ToyUnit:
    """A unit that follows its track exactly, as far as its authority and its collision monitor let it.

    On its first ``held_routes`` routes the monitor holds it ``held_m`` before the end of the leg on a path.
    When it sets off its wheels slip by ``slips_m``, which it does not know. Between two times ``hidden_s``
    nobody sees it; it stands, and after 10 s it says on its route that it is lost. From ``deaf_s`` on it
    hears nothing, and is heard. The first ``misses`` of its attempts to lock fail: it backs off along the
    lane of the port, stands for ``looks_s`` to look for the port, and comes again.
    """

    name: str
    X_WU: SE2
    body: Body
    holder: str | None = None
    dies_s: float = math.inf
    dies_in_lane: bool = False
    held_routes: int = 0
    held_m: float = 0.5
    slips_m: float = 0.0
    hidden_s: tuple[float, float] = (math.inf, math.inf)
    deaf_s: float = math.inf
    misses: int = 0
    looks_s: float = 0.0
    progress: float = 0.0
    speed: float = 0.0
    route: int = 0
    track: Track | None = None
    led_to: SE2 | None = None  # where the dock leg has been led
    waited_s: float = 0.0
    again_s: float = 0.0  # time until it is back at the port after an attempt that failed
    dead_s: float | None = None
    mode: UnitMode = UnitMode.STANDING
    authority: MovementAuthority = field(default_factory=lambda: MovementAuthority(LIMITS, TICK_NS * 1e-9))

    @property
    def leg(self) -> LegKind | None:
        legs = self.authority.legs
        return legs[self._leg].kind if legs else None

    @property
    def _leg(self) -> int:
        """Index of the leg that the unit is in, the last one at the end of the route."""
        legs = self.authority.legs
        return next((k for k, leg in enumerate(legs) if self.progress < leg.end - 1e-6), len(legs) - 1)

    @property
    def partner(self) -> str | None:
        """The unit whose port this one is in, enters or leaves."""
        newest = self.authority.newest
        if self.holder is not None:
            return self.holder.partition(".")[0]
        if self.leg is LegKind.DOCK and newest is not None and newest.to is not None:
            return newest.to.partition(".")[0]
        return self.left if self.leg is LegKind.BACK else None

    left: str | None = None
    now_ns: int = 0
    lost: bool = False

    def receive(self, message: Authority) -> None:
        if self.authority.receive(message):
            # One that reported that it stands may creep the last micrometres to a limit that was moved since.
            assert self.speed < 1e-4, f"{self.name} gets another route while it moves"
            self.route, self.progress, self.waited_s = message.route, 0.0, 0.0
            self.lost = False
            self.track, self.led_to = track_of(message.legs, self.X_WU, self.body.offset), None
            assert self.track.length == pytest.approx(self.authority.length, abs=0.05)

    def look_at(self, units: Mapping[str, ToyUnit]) -> None:
        """Lead the dock leg to where the port is, which the unit sees with its own camera."""
        newest = self.authority.newest
        assert newest is not None
        assert newest.to is not None
        assert self.track is not None
        holder, _, port = newest.to.partition(".")
        X_WE = self.body.docked(units[holder].X_WU, port)
        if self.led_to != X_WE:
            self.track, self.led_to = self.track.to_port(X_WE), X_WE

    @property
    def hidden(self) -> bool:
        return self.hidden_s[0] <= 1e-9 * self.now_ns < self.hidden_s[1]

    def step(self, now_ns: int) -> None:
        """Advance by one tick."""
        self.now_ns = now_ns
        dt, newest = 1e-9 * TICK_NS, self.authority.newest
        if self.dead_s is None and now_ns * 1e-9 >= self.dies_s and not self.holder:
            lane = self.track is not None and self.progress > self.authority.dock_start - 0.3
            if self.speed > 0.0 and (lane or not self.dies_in_lane):
                self.dead_s, self.speed = now_ns * 1e-9, 0.0
        if self.dead_s is not None:
            self.mode = UnitMode.FAILED if now_ns * 1e-9 > self.dead_s + SEIZED_S else UnitMode.STANDING
            return
        if newest is None or self.track is None:
            return
        if self.holder is not None:
            backwards = newest.legs[0].end if newest.legs else 0.0  # the way out of the port, in one go
            if not newest.unlock or self.progress > 0.0 or newest.limit < backwards - 1e-9:
                return
            self.waited_s += dt
            if self.waited_s < UNLOCK_S:
                return
            self.left, self.holder, self.waited_s = self.holder.partition(".")[0], None, 0.0
        if not self.authority.legs:  # the unit stands where it is to be
            self.mode = UnitMode.STANDING
            return
        if self.lost or self.hidden:
            self.speed, self.mode = 0.0, UnitMode.STANDING
            self.lost = self.lost or 1e-9 * now_ns - self.hidden_s[0] > UNSEEN_S
            if self.lost:
                self.mode = UnitMode.LOST
            return
        leg = self.authority.legs[self._leg]
        kind, end = leg.kind, leg.end
        limit = self.authority.limit(now_ns, self.progress, self.speed)
        most, rest, lag = min(end, limit), max(limit - self.progress, 0.0), DECELERATION * dt
        # A loop with a delay does not overshoot while its gain is below 1 / (e delay).
        allowed = min(math.sqrt(lag * lag + 2.0 * DECELERATION * rest) - lag, rest / (math.e * dt))
        to_end = math.sqrt(2.0 * ACCELERATION * max(end - self.progress, 0.0))
        self.speed = min(self.speed + ACCELERATION * dt, SPEED[kind], allowed, max(to_end, 0.01))
        if self.route <= self.held_routes and kind is LegKind.PATH:
            most = min(most, end - self.held_m)
        moved = min(self.speed * dt, max(most - self.progress, 0.0))
        self.progress += moved
        self.X_WU = self.track.at(self.progress) @ SE2(-self.slips_m * (self.progress > 0.0), 0.0, 0.0)
        if moved < 1e-9:
            self.speed = 0.0
        docks = kind is LegKind.DOCK
        self.mode = (
            UnitMode.STANDING if self.speed == 0.0 else UnitMode.DOCKING if docks else UnitMode.DRIVING
        )
        if docks and self.progress >= self.track.length - 1e-6:
            self._lock(newest.to, dt)

    def _lock(self, port: str | None, dt: float) -> None:
        """Lock at the end of the track, or go back a way and come again if the attempt fails."""
        assert self.track is not None
        self.mode, speed = UnitMode.DOCKING, SPEED[LegKind.DOCK]
        if self.again_s > 0.0:
            self.again_s = max(self.again_s - dt, 0.0)
            away_s, looked_s = RETREAT_M / speed, 2.0 * RETREAT_M / speed + self.looks_s - self.again_s
            stands = away_s < self.again_s and away_s < looked_s
            self.speed = 0.0 if stands else speed
            self.X_WU = self.track.at(self.track.length - speed * min(self.again_s, looked_s, away_s))
            return
        self.waited_s += dt
        if self.waited_s < LOCK_S:
            return
        if self.misses:
            self.misses, self.waited_s = self.misses - 1, 0.0
            self.again_s = 2.0 * RETREAT_M / speed + self.looks_s
        else:
            self.holder, self.mode = port, UnitMode.DOCKED

    def report(self, now_ns: int) -> UnitReport:
        newest = self.authority.newest
        seq = 0 if newest is None else newest.seq
        mode = UnitMode.DOCKED if self.holder is not None and self.dead_s is None else self.mode
        return UnitReport(
            self.name,
            now_ns,
            seq,
            self.route,
            self.progress,
            mode,
            self.holder,
            stopping=(tuple(self.X_WU.as_array().tolist()),) if self.speed > 0.0 else (),
            reason="seized" * (self.dead_s is not None),
        )


class Radio:
    """Delivers messages late, or not at all."""

    def __init__(self, spec: RadioSpec, rng: np.random.Generator) -> None:
        self._spec, self._rng = spec, rng
        self._queue: list[tuple[int, int, object]] = []
        self._count = itertools.count()
        self.sent = self.lost = 0

    def send(self, unit: str, message: object, now_ns: int) -> None:
        self.sent += 1
        late = self._spec.latency_ms + self._rng.random() * self._spec.jitter_ms
        silent = any(
            s.from_s <= now_ns * 1e-9 < s.until_s and (not s.units or unit in s.units)
            for s in self._spec.silences
        )
        if self._rng.random() < self._spec.loss or silent:
            self.lost += 1
            return
        heapq.heappush(self._queue, (now_ns + round(1e6 * late), next(self._count), message))

    def arrived(self, now_ns: int) -> list[object]:
        messages = []
        while self._queue and self._queue[0][0] <= now_ns:
            messages.append(heapq.heappop(self._queue)[2])
        return messages


@dataclass
class Rig:
    """A mission on toy units."""

    mission: Mission
    starts: Mapping[str, SE2]
    setup: CoordinationSetup
    radio: RadioSpec = field(default_factory=RadioSpec)
    seed: int = 0
    dies: Mapping[str, tuple[float, bool]] = field(default_factory=dict)
    now_ns: int = 0
    last_lock_s: float = 0.0
    moving_s: list[float] = field(default_factory=lambda: [0.0, 0.0])  # one unit or more, two or more
    authorities: list[Authority] = field(default_factory=list)
    sight: bool = True
    obstacles: tuple[ObstacleEstimate, ...] = ()  # that are seen, and that units do not know of
    noise: tuple[float, float] = (0.0, 0.0)  # of the overhead estimates [m], [rad]
    noisy_s: float = math.inf  # time after which they have settled

    def __post_init__(self) -> None:
        body = self.setup.lanes.body
        self.units = {
            name: ToyUnit(
                name, X, body, self.mission.holders.get(name), *self.dies.get(name, (math.inf, False))
            )
            for name, X in self.starts.items()
        }
        self.coordinator = Coordinator(self.mission, self.starts, self.setup)
        self._rng = np.random.default_rng([self.seed, 1])
        self._radio = Radio(self.radio, np.random.default_rng(self.seed))
        self._granted: dict[tuple[str, int], float] = {}
        self._sights: list[tuple[int, list[GlobalPose]]] = []

    @property
    def status(self) -> MissionStatus:
        return self.coordinator.status(self.now_ns)

    @property
    def joints(self) -> dict[str, str]:
        """Port of each unit that is docked, as the truth has it."""
        return {name: unit.holder for name, unit in self.units.items() if unit.holder is not None}

    def is_built(self, shape: Shape) -> bool:
        """Whether the units are docked to each other as the shape says, by truth."""
        return sorted(assembly_ports(self.joints).values()) == sorted(shape_ports(shape).values())

    def bound_s(self) -> float:
        """Least time [s] in which the docked units could have driven their last routes, all at the same time.

        No unit waits for anything but its parent, docks follow one another along the tree, and no unit has to
        speed up or brake.
        """
        return max(self._earliest_lock_s(name) for name in self.joints)

    def _earliest_lock_s(self, name: str) -> float:
        unit, drive, dock, begin = self.units[name], 0.0, 0.0, 0.0
        for leg in unit.authority.legs:
            time_s = (leg.end - begin) / SPEED[leg.kind]
            drive, dock = (drive, dock + time_s) if leg.kind is LegKind.DOCK else (drive + time_s, dock)
            begin = leg.end
        if unit.holder is None:
            return drive
        return max(drive, self._earliest_lock_s(unit.holder.partition(".")[0])) + dock + LOCK_S

    def run(self, seconds: float = 400.0) -> MissionStatus:
        while self.now_ns < 1e9 * seconds and self.coordinator.state is MissionState.RUNNING:
            self.step()
        return self.status

    def step(self) -> None:
        """Advance to the next step of the base station, and let it decide."""
        for _ in range(BASE_NS // TICK_NS):
            self._move()
        bodies = [
            GlobalPose(u.name, self.now_ns, self._seen(u.X_WU), COVARIANCE)
            for u in self.units.values()
            if not u.hidden
        ]
        self._sights.append((self.now_ns, bodies))
        while self._sights and self._sights[0][0] <= self.now_ns - CAMERA_NS:
            bodies = self._sights.pop(0)[1]
            if self.sight or self.now_ns < 1_000_000_000:
                self.coordinator.observe(bodies, self.now_ns, self.obstacles)
                self._judge_knowledge()
        for message in self.coordinator.step(self.now_ns):
            key = (message.unit, message.route)
            assert message.limit >= self._granted.get(key, -math.inf), "an authority shrinks"
            self._granted[key] = message.limit
            self.authorities.append(message)
            self._radio.send(message.unit, message, self.now_ns)

    def _move(self) -> None:
        """Advance the units by one tick, and deliver what arrives."""
        self.now_ns += TICK_NS
        period = round(1e9 / self.radio.rate_hz)
        for k, unit in enumerate(self.units.values()):
            was = unit.holder
            if not unit.holder and unit.progress > unit.authority.dock_start and unit.leg is LegKind.DOCK:
                unit.look_at(self.units)
            unit.step(self.now_ns)
            if unit.holder is not None and was is None:
                self.last_lock_s = self.now_ns * 1e-9
            if (self.now_ns + k * TICK_NS) % period == 0:
                self._radio.send(unit.name, unit.report(self.now_ns), self.now_ns)
        self._judge()
        for message in self._radio.arrived(self.now_ns):
            if isinstance(message, Authority):
                if self.now_ns * 1e-9 < self.units[message.unit].deaf_s:
                    self.units[message.unit].receive(message)
            else:
                assert isinstance(message, UnitReport)
                self.coordinator.receive(message, self.now_ns)

    def _seen(self, X_WU: SE2) -> SE2:
        if self.noise == (0.0, 0.0) or self.now_ns > 1e9 * self.noisy_s:
            return X_WU
        x, y, yaw = self._rng.normal(0.0, 1.0, 3) * [self.noise[0], self.noise[0], self.noise[1]]
        return SE2(X_WU.x + x, X_WU.y + y, X_WU.yaw + yaw)

    def _judge_knowledge(self) -> None:
        """Compare what is known with the truth: ground that a unit has still to drive on is not free yet."""
        for known in self.status.units:
            unit = self.units[known.unit]
            if known.state is UnitState.UNDER_WAY:
                driven = unit.progress if unit.route == known.route else 0.0
                assert known.progress <= driven + 1e-6, (
                    f"{unit.name} is {driven:.3f} m along its route, not {known.progress:.3f} m"
                )

    def _judge(self) -> None:
        """Compare all bodies as they are: none may touch, and none may be where it was not allowed."""
        units = list(self.units.values())
        moving = sum(unit.speed > 0.0 for unit in units)
        for k in range(2):
            self.moving_s[k] += 1e-9 * TICK_NS * (moving > k)
        for unit in units:
            if unit.route:
                assert unit.progress <= self._granted[unit.name, unit.route] + 1e-6 or unit.progress == 0.0, (
                    f"{unit.name} is on ground that was not granted"
                )
        if not moving:
            return
        body = self.setup.lanes.body
        for a, b in itertools.combinations(units, 2):
            if a.speed == 0.0 and b.speed == 0.0:
                continue
            if math.hypot(a.X_WU.x - b.X_WU.x, a.X_WU.y - b.X_WU.y) > 2.0 * body.radius:
                continue  # they cannot touch, however they are turned
            if a.partner == b.name or b.partner == a.name:
                continue
            gap = body.gap(a.X_WU, b.X_WU)
            assert gap > 0.0, f"{a.name} and {b.name} touch at {self.now_ns * 1e-9:.1f} s"


@pytest.fixture(scope="session")
def rig(setup: CoordinationSetup) -> Callable[..., Rig]:
    """The rig's class, with the shipped units in the arena of 4 m by 3 m if nothing else is said."""
    return partial(Rig, setup=setup)
