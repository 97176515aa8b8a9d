"""Single decisions of the phase machine, each with an observation made for that decision alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from msrr_control.docking.controller import build_controller
from msrr_control.docking.law import DockSetup
from msrr_control.kinematics.drive_limits import nested_limiter
from msrr_control.sequence.evidence import with_doubt
from msrr_control.sequence.observation import Assembler, Observation
from msrr_control.sequence.state_machine import PhaseMachine
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    CollisionMonitorState,
    Conviction,
    FailureReason,
    LockFeedback,
    LockPosition,
    LosObservation,
    LosStatus,
    MonitorState,
    Phase,
    PoseEstimate,
    SeatSwitches,
    Twist,
    seconds,
)
from msrr_scenes.specs.control import DockingSpec, VerifySpec
from msrr_scenes.specs.spec import Choice

DT_NS = 20_000_000
SURE = np.diag([1e-6, 1e-6, 1e-6])
TUNING = PhaseTuning()
CAPTURE_M = TUNING.capture_share * 0.015  # of the mouths of `facts`
SIGHTLESS = DockingSpec(verify=VerifySpec(by_sight=False))


@dataclass
class Desk:
    """A phase machine and the observations that are put to it, without any truth."""

    facts: DockSetup
    spec: DockingSpec = field(default_factory=DockingSpec)
    tuning: PhaseTuning = field(default_factory=PhaseTuning)
    now_ns: int = 0
    lock: LockFeedback | None = None
    assembler: Assembler | None = None

    def __post_init__(self) -> None:
        law = build_controller(Choice(name="c1"), self.facts)
        self.machine = PhaseMachine(self.spec, self.facts, law, self.assembler, tuning=self.tuning)

    def at(self, gap: float, lateral: float = 0.0, yaw: float = 0.0) -> SE2:
        """The axle's pose whose front port has that gap and that offset from the docking axis."""
        tip = self.facts.offset
        return SE2(-gap - tip * math.cos(yaw), lateral - tip * math.sin(yaw), yaw)

    def ask(
        self,
        X_DU: SE2 | None,
        *,
        exposed_ns: int | None = None,
        covariance: np.ndarray = SURE,
        los: LosObservation | None = None,
        closed: bool | tuple[bool, bool] | None = None,
        lock: tuple[LockPosition, int] | None = None,
        twist: Twist | None = None,
        monitor: CollisionMonitorState | None = None,
        passed: Twist | None = None,
        overhead_ns: int | None = None,
    ) -> Action:
        """Let 20 ms go by and ask; the pose was exposed now unless told otherwise.

        The last report of the lock stays in force; ``closed`` is of both seat switches, or left and right.
        """
        self.now_ns += DT_NS
        now = self.now_ns
        seen = now if exposed_ns is None else exposed_ns
        left, right = closed if isinstance(closed, tuple) else (closed, closed)
        self.lock = self.lock if lock is None else LockFeedback("a", lock[1], lock[0])
        return self.machine.step(
            Observation(
                now_ns=now,
                pose=None if X_DU is None else PoseEstimate(now, X_DU, covariance, seen),
                los=los,
                switches=None if closed is None else SeatSwitches("a", now, bool(left), bool(right)),
                lock=self.lock,
                twist=twist or Twist(),
                monitor=monitor,
                passed=passed,
                overhead_exposed_ns=overhead_ns,
            )
        )

    def to_dock(self) -> None:
        """Into the approach, far from the port."""
        assert self.ask(self.at(0.7)).phase is Phase.DOCK

    def to_lock(self, gap: float = 0.0) -> None:
        """Seated, both switches closed for as long as it takes."""
        self.to_dock()
        for _ in range(8):
            if self.ask(self.at(gap), closed=True).phase is Phase.LOCK:
                return
        raise AssertionError(f"no lock: {self.machine.phase}")

    def to_verify(self) -> None:
        """The cam has reported that it is closed."""
        self.to_lock()
        action = self.ask(self.at(0.0), closed=True, lock=(LockPosition.CLOSED, self.now_ns + DT_NS))
        # That frame was exposed no later than the phase began: it does not count.
        assert action.phase is Phase.VERIFY


@pytest.fixture
def desk(facts: DockSetup) -> Desk:
    return Desk(facts)


# The hand-over: seen, inside the cone, and certain, or no approach.


def _edges(left: float, right: float) -> LosObservation:
    return LosObservation(DT_NS, left, right, 0.0, LosStatus.SEEN)


def _wide(sigma_y: float, sigma_yaw: float) -> np.ndarray:
    return np.diag([1e-6, sigma_y**2, sigma_yaw**2])


@pytest.mark.parametrize(("share", "stalls"), [(0.5, False), (0.05, True)])
def test_a_slow_drive_is_measured_by_what_it_may_go(facts: DockSetup, share: float, stalls: bool) -> None:
    """It may do 1 cm/s, and the law asks for 11: half of that is progress, a twentieth is none."""
    desk = Desk(replace(facts, limits=facts.limits.model_copy(update={"v_close_mps": 0.01})))
    actions = [desk.ask(desk.at(0.7 - share * 0.01 * 0.02 * k)) for k in range(400)]
    assert any("no progress" in action.reason for action in actions) == stalls


@pytest.mark.parametrize(
    ("beyond_m", "share_of_cone", "creeps"), [(0.01, 0.5, True), (-0.01, 0.5, False), (0.01, 1.02, False)]
)
def test_a_unit_that_is_not_certain_comes_nearer_but_not_too_near(
    desk: Desk, beyond_m: float, share_of_cone: float, creeps: bool
) -> None:
    """In sight of the port; outside of the cone it would lose it."""
    gap = TUNING.search.creep_gap_m + beyond_m
    edge = share_of_cone * desk.facts.los.outer
    action = desk.ask(
        desk.at(gap), covariance=_wide(2.0 * TUNING.ready_sigma_m, 0.0), los=_edges(edge, edge - 0.1)
    )
    assert action.phase is Phase.HAND_OVER
    assert action.twist.v == (TUNING.search.creep_mps if creeps else 0.0)


@pytest.mark.parametrize(
    ("share_of_cone", "sigma_y", "sigma_yaw_deg", "docks"),
    [
        (0.98, 0.0, 0.0, True),
        (1.02, 0.0, 0.0, False),
        (-1.02, 0.0, 0.0, False),
        (0.5, 0.95 * TUNING.ready_sigma_m, 0.0, True),
        (0.5, 1.05 * TUNING.ready_sigma_m, 0.0, False),
        (0.5, 0.0, 0.95 * TUNING.ready_sigma_deg, True),
        (0.5, 0.0, 1.05 * TUNING.ready_sigma_deg, False),
    ],
)
def test_an_approach_begins_with_a_certain_look_inside_the_cone(
    desk: Desk, share_of_cone: float, sigma_y: float, sigma_yaw_deg: float, docks: bool
) -> None:
    edge = share_of_cone * desk.facts.los.outer
    los = _edges(edge, 0.5 * edge) if edge > 0.0 else _edges(0.5 * edge, edge)
    action = desk.ask(desk.at(0.6), covariance=_wide(sigma_y, math.radians(sigma_yaw_deg)), los=los)
    assert action.phase is (Phase.DOCK if docks else Phase.HAND_OVER)


@pytest.mark.parametrize(("outside", "says"), [(True, "outside the cone"), (False, "uncertain")])
def test_a_look_that_stays_unready_ends_the_attempt(desk: Desk, outside: bool, says: str) -> None:
    edge = (1.1 if outside else 0.5) * desk.facts.los.outer
    covariance = SURE if outside else _wide(0.1, 0.1)
    while desk.machine.phase is not Phase.RETREAT:
        assert desk.now_ns < 1e9 * (TUNING.ready_time_s + 0.1)
        desk.ask(desk.at(TUNING.search.creep_gap_m), covariance=covariance, los=_edges(edge, 0.0))
    assert desk.machine.belief.setback is FailureReason.UNREADY
    assert says in desk.machine.belief.reason


def test_a_unit_comes_as_near_as_it_may_before_it_gives_up_an_uncertain_look(desk: Desk) -> None:
    """A camera that reads one tag in front of the port knows its heading only from nearer."""
    gap, los = 0.7, _edges(0.5 * desk.facts.los.outer, 0.0)
    while desk.machine.phase is not Phase.RETREAT:
        assert gap > TUNING.search.creep_gap_m - 0.01
        gap -= 1e-9 * DT_NS * desk.ask(desk.at(gap), covariance=_wide(0.1, 0.1), los=los).twist.v
    assert gap == pytest.approx(TUNING.search.creep_gap_m, abs=0.01)


@pytest.mark.parametrize(("gap", "way"), [(0.7, TUNING.search.unseen_m), (TUNING.search.creep_gap_m, 0.0)])
def test_a_unit_comes_nearer_to_a_target_that_it_has_lost_before_it_looks_around(
    desk: Desk, gap: float, way: float
) -> None:
    """Once for each time that it was seen, and not too near; then it has all its time to look around."""
    los = _edges(0.5 * desk.facts.los.outer, 0.0)
    for _ in range(2):
        desk.ask(desk.at(gap), covariance=_wide(0.1, 0.1), los=los)
        seen_ns, crept, turned = desk.now_ns, 0.0, False
        while desk.now_ns - seen_ns < 6e9:
            twist = desk.ask(desk.at(gap - crept), covariance=_wide(0.1, 0.1), exposed_ns=seen_ns).twist
            crept += 1e-9 * DT_NS * twist.v
            turned = turned or abs(twist.w) > 0.1
        before = TUNING.search.creep_mps * DockingSpec().lost_time_s if way else 0.0  # as one that is seen
        assert crept == pytest.approx(before + way, abs=0.002)
        assert turned
    while desk.machine.phase is Phase.HAND_OVER:
        desk.ask(desk.at(gap - crept), covariance=_wide(0.1, 0.1), exposed_ns=seen_ns)
    lasted = 1e-9 * (desk.now_ns - seen_ns) - way / TUNING.search.creep_mps
    assert lasted == pytest.approx(DockingSpec().search_time_s + DockingSpec().lost_time_s, abs=0.1)


def test_a_target_that_is_found_late_still_has_all_its_time_to_become_certain(desk: Desk) -> None:
    uncertain, los = _wide(0.1, 0.1), _edges(0.5 * desk.facts.los.outer, 0.0)
    while desk.now_ns < 0.9e9 * DockingSpec().search_time_s:
        assert desk.ask(None).phase is Phase.HAND_OVER
    found_s = 1e-9 * desk.now_ns
    assert found_s > TUNING.ready_time_s
    while desk.machine.phase is Phase.HAND_OVER:
        desk.ask(desk.at(TUNING.search.creep_gap_m), covariance=uncertain, los=los)
    assert 1e-9 * desk.now_ns - found_s == pytest.approx(TUNING.ready_time_s, abs=0.05)
    assert desk.machine.belief.setback is FailureReason.UNREADY


def _unready(desk: Desk, X_DU: SE2) -> Action:
    return desk.ask(X_DU, covariance=_wide(0.1, 0.1))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_an_unready_unit_turns_towards_the_target_it_sees(desk: Desk, side: float) -> None:
    """A target to the left asks for a turn to the left, whether the place or the heading puts it there."""
    for X_DU in (SE2(-0.7, -0.2 * side, 0.0), SE2(-0.7, 0.0, -0.2 * side)):
        action = _unready(desk, X_DU)
        assert action.phase is Phase.HAND_OVER
        assert math.copysign(1.0, action.twist.w) == side


@pytest.mark.parametrize("y", [-0.25, 0.25])
def test_turning_as_commanded_brings_the_target_to_the_camera_s_axis(desk: Desk, y: float) -> None:
    X = SE2(-0.7, y, 0.0)
    for _ in range(100):
        w = _unready(desk, X).twist.w
        X = X @ SE2(0.0, 0.0, 0.02 * w)
    target = X.inverse().act([desk.facts.los.setback_m, 0.0])
    assert math.atan2(target[1], target[0]) == pytest.approx(0.0, abs=math.radians(0.5))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_search_begins_where_the_target_was_last_seen(desk: Desk, side: float) -> None:
    """Unseen for 0.3 s while it waits (the scan itself has not begun): it turns to the target's side."""
    X_DU = SE2(-0.7, -0.2 * side, 0.0)
    _unready(desk, X_DU)
    seen_ns = desk.now_ns
    while desk.now_ns - seen_ns < 1e9 * (desk.spec.lost_time_s + 0.3):
        action = desk.ask(X_DU, exposed_ns=seen_ns, covariance=_wide(0.1, 0.1))
    assert action.phase is Phase.HAND_OVER
    assert action.twist.v == 0.0
    assert math.copysign(1.0, action.twist.w) == side


@pytest.mark.parametrize("w", [-0.5, 0.5])
def test_a_unit_that_has_seen_nothing_searches_about_its_first_heading(desk: Desk, w: float) -> None:
    """Turned away by 0.1 rad while it waits: it turns back."""
    for _ in range(10):
        action = desk.ask(None, twist=Twist(0.0, w))
    assert math.copysign(1.0, action.twist.w) == -math.copysign(1.0, w)


@pytest.mark.parametrize("by", ["sight", "route"])
def test_a_search_begins_where_the_unit_last_faced_the_port(facts: DockSetup, by: str) -> None:
    """It looks to the left first, and would turn to the right if it counted turns of before."""
    desk = Desk(facts, assembler=_InPlace(10 if by == "route" else 0))
    for _ in range(10):
        desk.ask(None, twist=Twist(0.0, 1.0))
    if by == "sight":
        assert desk.ask(desk.at(0.7), covariance=_wide(0.1, 0.1)).phase is Phase.HAND_OVER
    turns = [desk.ask(None).twist for _ in range(50)]
    assert all(turn.v == 0.0 and turn.w >= 0.0 for turn in turns)
    assert turns[-1].w > 0.0


@pytest.mark.parametrize("assembled", [True, False])
def test_a_target_that_was_seen_is_looked_for_from_nearer_where_the_long_distance_phase_has_led(
    facts: DockSetup, assembled: bool
) -> None:
    """With an estimate that says nothing; otherwise the target may be near."""
    desk, nothing = Desk(facts, assembler=_InPlace()), _wide(0.6, 0.8)
    nothing[0, 0] = 0.4**2
    if not assembled:
        desk.to_dock()
    else:
        desk.ask(desk.at(0.7), covariance=nothing, los=_edges(0.5 * facts.los.outer, 0.0))
    seen_ns, crept = desk.now_ns, 0.0
    while desk.machine.phase is not Phase.RETREAT:
        desk.ask(desk.at(0.7), covariance=nothing, exposed_ns=seen_ns)
    while desk.machine.phase in (Phase.RETREAT, Phase.ASSEMBLE):
        desk.ask(desk.at(0.7), covariance=nothing, exposed_ns=seen_ns, lock=(LockPosition.OPEN, desk.now_ns))
    while desk.machine.phase is Phase.HAND_OVER:
        crept += 0.02 * desk.ask(desk.at(0.7), covariance=nothing, exposed_ns=seen_ns).twist.v
    assert crept == pytest.approx(TUNING.search.unseen_m if assembled else 0.0, abs=0.001)


# At the port: pressing, and what makes it close the lock.


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("lateral_m", "yaw_deg", "presses"),
    [
        (0.0, 10.0, False),
        (0.0, 1.05 * TUNING.capture_deg, False),
        (0.0, 0.95 * TUNING.capture_deg, True),
        (1.05 * CAPTURE_M, 0.0, False),
        (0.95 * CAPTURE_M, 0.0, True),
    ],
)
def test_it_presses_only_from_where_the_funnel_captures(
    desk: Desk, side: float, lateral_m: float, yaw_deg: float, presses: bool
) -> None:
    desk.to_dock()
    contact = desk.facts.pin_reach
    action = desk.ask(desk.at(contact, side * lateral_m, side * math.radians(yaw_deg)), closed=False)
    if presses:
        assert (action.phase, action.twist.v) == (Phase.DOCK, desk.spec.press_mps)
    else:
        assert action.phase is Phase.RETREAT
        assert desk.machine.belief.setback is FailureReason.OFF_AXIS


@pytest.mark.parametrize("at_bottom", [False, True])
def test_a_unit_that_turns_too_far_at_the_port_was_beside_the_axis_or_slid_away(
    desk: Desk, at_bottom: bool
) -> None:
    """With one pin at the bottom it comes again more slowly, turned; if no pin was, beside the axis."""
    desk.to_dock()
    for _ in range(10):
        assert desk.ask(desk.at(0.6 * desk.facts.pin_reach), closed=(at_bottom, False)).phase is Phase.DOCK
    turned = desk.at(0.6 * desk.facts.pin_reach, 0.0, math.radians(10.0))
    assert desk.ask(turned, closed=False).phase is Phase.RETREAT
    assert desk.machine.belief.setback is FailureReason.OFF_AXIS
    beside_m = (1.0 - TUNING.capture_share) * desk.facts.mouth
    X_DA = SE2(0.0, 0.0, 2e-3) if at_bottom else SE2(0.0, beside_m, 0.0)  # the left pin was there first
    backs = desk.ask(X_DA @ desk.at(0.2), closed=False, lock=(LockPosition.OPEN, desk.now_ns + DT_NS))
    while desk.machine.phase is not Phase.DOCK:
        desk.ask(desk.at(desk.spec.retreat_m), closed=False)
    press = desk.ask(X_DA @ desk.at(0.9 * desk.facts.pin_reach), closed=False)
    assert (backs.phase, press.phase, press.attempt) == (Phase.RETREAT, Phase.DOCK, 2)
    assert backs.twist.v < 0.0
    assert press.twist.v == desk.spec.press_mps * (TUNING.slower_share if at_bottom else 1.0)
    assert max(abs(backs.twist.w), abs(press.twist.w)) < 1e-9  # it is on the line at which it aims
    if at_bottom:  # not in this attempt
        for _ in range(30):
            desk.ask(desk.at(0.6 * desk.facts.pin_reach), closed=False)
        assert desk.ask(turned, closed=False).phase is Phase.RETREAT
        while desk.machine.phase is not Phase.DOCK:
            desk.ask(desk.at(desk.spec.retreat_m), closed=False)
        X_DA = SE2(0.0, beside_m, 2e-3)
        assert abs(desk.ask(X_DA @ desk.at(0.9 * desk.facts.pin_reach), closed=False).twist.w) < 1e-9


@pytest.mark.parametrize("at_bottom", [False, True])
def test_a_unit_presses_no_longer_when_both_seat_switches_have_opened_at_the_port(
    desk: Desk, at_bottom: bool
) -> None:
    """It slides out. One that has never been at the bottom may be on its way there."""
    desk.to_dock()
    seen = desk.at(0.3 * desk.facts.pin_reach)
    assert desk.ask(seen, closed=(False, at_bottom)).twist.v == desk.spec.press_mps
    begin_ns = desk.now_ns
    while (action := desk.ask(seen, closed=False)).phase is Phase.DOCK:
        assert action.twist.v == desk.spec.press_mps
    lasted_s = 1e-9 * (desk.now_ns - begin_ns)
    slid = (TUNING.parted_s, FailureReason.OFF_AXIS)
    longest_s, setback = slid if at_bottom else (desk.spec.stall_time_s, FailureReason.STALLED)
    assert longest_s < lasted_s < longest_s + 0.1
    assert (action.phase, desk.machine.belief.setback) == (Phase.RETREAT, setback)


def test_a_unit_that_sees_itself_arrive_beside_the_port_aims_at_it_again(desk: Desk) -> None:
    desk.to_dock()
    assert desk.ask(desk.at(desk.facts.pin_reach, 1.05 * CAPTURE_M), closed=False).phase is Phase.RETREAT
    while desk.machine.phase is not Phase.DOCK:
        desk.ask(desk.at(desk.spec.retreat_m), closed=False, lock=(LockPosition.OPEN, desk.now_ns + DT_NS))
    assert abs(desk.ask(desk.at(desk.facts.pin_reach), closed=False).twist.w) < 1e-9


def test_a_unit_that_is_not_held_in_its_seat_comes_more_slowly_the_next_time(desk: Desk) -> None:
    desk.to_verify()
    while desk.machine.phase is Phase.VERIFY:
        desk.ask(desk.at(0.0), closed=(True, False))
    assert desk.machine.belief.setback is FailureReason.NOT_VERIFIED
    while desk.machine.phase is not Phase.DOCK:
        desk.ask(desk.at(desk.spec.retreat_m), closed=False, lock=(LockPosition.OPEN, desk.now_ns + DT_NS))
    press = desk.ask(desk.at(desk.facts.pin_reach), closed=False)
    assert press.twist.v == TUNING.slower_share * desk.spec.press_mps


@pytest.mark.parametrize("mouth", [0.0005, 0.003, 0.04])
def test_it_presses_on_the_axis_of_mouths_of_any_width(facts: DockSetup, mouth: float) -> None:
    desk = Desk(replace(facts, mouth=mouth))
    desk.to_dock()
    for lateral, phase in ((0.7 * mouth, Phase.DOCK), (mouth, Phase.RETREAT)):
        assert desk.ask(desk.at(facts.pin_reach, lateral, 0.0), closed=False).phase is phase


def test_pins_in_the_holes_are_pressed_whatever_sight_says_of_the_side(desk: Desk) -> None:
    desk.to_dock()
    action = desk.ask(desk.at(0.4 * desk.facts.pin_reach, 2.0 * CAPTURE_M, 0.0), closed=False)
    assert (action.phase, action.twist.v) == (Phase.DOCK, desk.spec.press_mps)


def _turn_after_jam(
    desk: Desk,
    yaw: float,
    sigma_y: float,
    monitor: CollisionMonitorState | None = None,
    closed: bool | tuple[bool, bool] = False,
    near: float | None = None,
    passed: Twist | None = None,
    goes: bool = False,
) -> float:
    """Let pins jam in the port, and return how a unit on the axis turns in the next attempt.

    The side is known to ``sigma_y`` [m] on the way, and to ``near`` [m] from a gap of 25 mm on. A unit that
    ``goes`` moves as the collision monitor lets it, and is held by nothing else.
    """
    covariance = _wide(sigma_y, 1e-3)
    desk.ask(desk.at(0.1), covariance=covariance)
    covariance = covariance if near is None else _wide(near, 1e-3)
    desk.ask(desk.at(0.025), covariance=covariance)
    gap = 0.020 if goes else 0.003
    for _ in range(400):
        gap -= 1e-9 * DT_NS * passed.v if goes and passed is not None else 0.0
        at_port = desk.ask(
            desk.at(gap, 0.0, yaw), closed=closed, covariance=covariance, monitor=monitor, passed=passed
        )
        if at_port.phase is Phase.RETREAT:
            break
    assert desk.machine.belief.setback is FailureReason.STALLED
    for _ in range(400):
        action = desk.ask(desk.at(desk.spec.retreat_m))
        if action.phase is Phase.DOCK:
            return desk.ask(desk.at(0.3)).twist.w
    raise AssertionError(f"no second attempt: {desk.machine.phase}")


@pytest.mark.parametrize("yaw", [-0.02, 0.02])
def test_after_a_jam_it_aims_to_the_side_to_which_the_funnel_has_turned_it(
    facts: DockSetup, yaw: float
) -> None:
    """And halfway back when the next jam turns it the other way."""
    desk = Desk(facts)
    desk.to_dock()
    first = _turn_after_jam(desk, yaw, 0.002) * yaw
    second = _turn_after_jam(desk, -yaw, 0.002) * yaw
    assert 0.0 < second < first


@pytest.mark.parametrize("yaw", [-0.02, 0.02])
def test_the_next_attempt_is_another_one_however_sure_of_the_side_sight_is(
    facts: DockSetup, yaw: float
) -> None:
    sure, doubtful = Desk(facts), Desk(facts)
    for each in (sure, doubtful):
        each.to_dock()
    turn = _turn_after_jam(sure, yaw, 0.0)
    assert turn * yaw > 0.0
    assert turn == _turn_after_jam(doubtful, yaw, 0.001)


@pytest.mark.parametrize(("closed", "yaw"), [((True, False), 0.01), ((False, True), -0.01)])
@pytest.mark.parametrize("sigma_y", [0.0, 0.002])
def test_the_pin_that_is_in_tells_the_side_of_a_jam_where_sight_says_the_other(
    facts: DockSetup, closed: tuple[bool, bool], yaw: float, sigma_y: float
) -> None:
    """A camera that is off by two degrees shows a unit turned to the wrong side; the holes turn it by one."""
    by_sight, by_switch = Desk(facts), Desk(facts)
    for each in (by_sight, by_switch):
        each.to_dock()
    seen = _turn_after_jam(by_sight, yaw, sigma_y)
    told = _turn_after_jam(by_switch, yaw, sigma_y, closed=closed)
    assert seen * told < 0.0


def test_doubt_about_the_wheels_at_the_port_does_not_lead_the_next_attempt_farther_aside(
    facts: DockSetup,
) -> None:
    """There each wheel may spin, and the side is less certain than a moment ago; sight is off by no more."""
    turns = []
    for near in (0.002, 0.02):
        desk = Desk(facts)
        desk.to_dock()
        turns.append(_turn_after_jam(desk, 0.02, 0.002, near=near))
    assert turns[0] == turns[1]


SLOW = CollisionMonitorState(0, MonitorState.SLOW, None, None, 1.0)
STOP = CollisionMonitorState(0, MonitorState.STOP, None, None, 1.0)


@pytest.mark.parametrize(
    ("monitor", "passed", "aims"),
    [
        (None, None, True),
        (SLOW, Twist(0.25 * DockingSpec().press_mps), True),
        (SLOW, Twist(0.0, 0.2), False),
        (STOP, Twist(), False),
    ],
)
def test_a_unit_that_the_monitor_does_not_let_go_on_does_not_press(
    facts: DockSetup, monitor: CollisionMonitorState | None, passed: Twist | None, aims: bool
) -> None:
    """So that it has stopped in the port is no jam; one that is only slowed down presses."""
    desk = Desk(facts)
    desk.to_dock()
    assert (_turn_after_jam(desk, 0.02, 0.001, monitor, passed=passed) != 0.0) is aims


@pytest.mark.parametrize("share", [0.02, 0.0625])
def test_a_unit_that_creeps_into_the_port_as_the_monitor_lets_it_is_not_jammed(
    facts: DockSetup, share: float
) -> None:
    """It took its stall for a jam, and aimed beside the port from then on."""
    desk = Desk(facts)
    desk.to_dock()
    creeps = Twist(share * DockingSpec().press_mps)
    assert _turn_after_jam(desk, 0.02, 0.001, SLOW, passed=creeps, goes=True) == 0.0


def _phases(desk: Desk, gap: float, steps: int, closed: bool = True) -> Sequence[Phase]:
    return [desk.ask(desk.at(gap), closed=closed).phase for _ in range(steps)]


@pytest.mark.parametrize("seated_gap", [0.0, 0.0015])
@pytest.mark.parametrize(("share", "locks"), [(0.95, True), (1.05, False), (-1.95, True), (-2.05, False)])
def test_switches_are_believed_at_the_gap_of_a_seated_unit_only(
    facts: DockSetup, seated_gap: float, share: float, locks: bool
) -> None:
    desk = Desk(facts, tuning=PhaseTuning(seated_gap_m=seated_gap))
    desk.to_dock()
    near = with_doubt(desk.tuning.near_m, math.sqrt(SURE[0, 0]))
    phases = _phases(desk, seated_gap + share * near, 20)
    assert (Phase.LOCK in phases) is locks
    assert locks or set(phases) == {Phase.DOCK}


@pytest.mark.parametrize("sigma_mm", [0.0, 1.0, 3.0])
def test_sight_that_is_less_certain_refuses_fewer_seated_units(facts: DockSetup, sigma_mm: float) -> None:
    """5 mm off the seat: too far for a view without errors, within two standard deviations of a bad one."""
    desk = Desk(facts)
    desk.to_dock()
    covariance = _wide(0.001, 0.001)
    covariance[0, 0] = (1e-3 * sigma_mm) ** 2
    phases = [desk.ask(desk.at(0.005), closed=True, covariance=covariance).phase for _ in range(20)]
    assert (Phase.LOCK in phases) is (sigma_mm == 3.0)


def test_who_does_not_look_believes_the_switches_at_the_port_and_nowhere_else(facts: DockSetup) -> None:
    desk = Desk(facts, spec=SIGHTLESS)
    desk.to_dock()
    assert set(_phases(desk, 0.1, 20)) == {Phase.DOCK}
    assert Phase.LOCK in _phases(desk, 2.0 * TUNING.near_m, 20)


def test_switches_are_believed_once_they_have_been_closed_for_the_debounce_time(desk: Desk) -> None:
    desk.to_dock()
    late = round(1e9 * TUNING.debounce_s / DT_NS)
    assert set(_phases(desk, 0.0, late)) == {Phase.DOCK}
    assert _phases(desk, 0.0, 1, closed=False) == [Phase.DOCK]  # a bounce: the time begins anew
    assert set(_phases(desk, 0.0, late)) == {Phase.DOCK}
    assert _phases(desk, 0.0, 1) == [Phase.LOCK]


def test_pins_that_are_in_are_pressed_no_further(desk: Desk) -> None:
    """Where the switches say so and sight agrees: while they are not yet believed, wheels push the target."""
    desk.to_dock()
    assert desk.ask(desk.at(0.0), closed=True).twist == Twist()
    for gap, closed in ((0.0, False), (0.015, True), (0.0, (True, False))):
        action = desk.ask(desk.at(gap), closed=closed)
        assert (action.phase, action.twist.v) == (Phase.DOCK, desk.spec.press_mps)


# While the cam closes.


def test_it_stands_while_the_cam_closes(desk: Desk) -> None:
    """Wheels that turn slowly push as hard as fast ones: on a slippery floor the target slid along."""
    desk.to_lock()
    action = desk.ask(desk.at(0.0), closed=True, lock=(LockPosition.CLOSING, desk.now_ns))
    assert (action.phase, action.lock) == (Phase.LOCK, True)
    assert action.twist == Twist()


def test_a_report_from_before_the_cam_was_commanded_to_close_is_none(desk: Desk) -> None:
    """A CLOSED that an earlier attempt left behind does not count, however often it is heard."""
    desk.to_lock()
    stale = desk.now_ns - DT_NS
    while desk.machine.phase is Phase.LOCK:
        assert desk.now_ns < 60e9
        desk.ask(desk.at(0.0), closed=True, lock=(LockPosition.CLOSED, stale))
    assert desk.machine.phase is Phase.RETREAT
    assert desk.machine.belief.setback is FailureReason.NOT_LATCHED


def test_a_report_from_after_it_does(desk: Desk) -> None:
    desk.to_lock()
    for position in (LockPosition.OPEN, LockPosition.CLOSING):
        assert desk.ask(desk.at(0.0), closed=True, lock=(position, desk.now_ns)).phase is Phase.LOCK
    assert desk.ask(desk.at(0.0), closed=True, lock=(LockPosition.CLOSED, desk.now_ns)).phase is Phase.VERIFY


def _held_s(desk: Desk, clearance: float, most_s: float) -> tuple[float, Action]:
    """Let the collision monitor stop an approach for a body; return for how long the unit asked to go on."""
    desk.to_dock()
    began = desk.now_ns
    while True:
        stop = CollisionMonitorState(desk.now_ns, MonitorState.STOP, "c", clearance, -0.1)
        action = desk.ask(desk.at(0.45), monitor=stop)
        if action.phase is not Phase.DOCK or seconds(desk.now_ns - began) > most_s:
            return seconds(desk.now_ns - began), action


def test_a_unit_waits_for_others_that_nobody_sees(facts: DockSetup) -> None:
    """The camera above was dark, and a unit in front of its port used up its attempts for one 1.5 m away."""
    waited_s, action = _held_s(Desk(facts), 1.5, 60.0)
    assert waited_s == pytest.approx(TUNING.doubt_s, abs=0.1)
    assert "by the collision monitor: 1500 mm to c, 0 mm of it certain ahead" in action.reason
    desk = Desk(facts)
    _, action = _held_s(desk, 1.5, 0.8 * TUNING.doubt_s)
    assert action.phase is Phase.DOCK
    seen = CollisionMonitorState(desk.now_ns, MonitorState.FREE, None, None, 1.0)
    assert desk.ask(desk.at(0.449), monitor=seen).phase is Phase.DOCK, (
        "it goes on as soon as somebody sees them"
    )


def test_a_unit_that_somebody_is_beside_does_not_wait(facts: DockSetup) -> None:
    desk = Desk(facts)
    held_s, action = _held_s(desk, 0.05, 60.0)
    assert held_s == pytest.approx(desk.spec.stall_time_s, abs=0.1)
    assert "50 mm to c" in action.reason


def test_a_lock_has_the_time_that_it_takes_to_close(facts: DockSetup) -> None:
    """One that took more than 3 s was opened again, whatever its data sheet says."""
    desk = Desk(replace(facts, close_time_s=4.0))
    desk.to_lock()
    began, action = desk.now_ns, None
    while action is None or action.phase is Phase.LOCK:
        action = desk.ask(desk.at(0.0), closed=True, lock=(LockPosition.CLOSING, desk.now_ns))
    assert action.reason == "cam not closed in 5.0 s"
    assert seconds(desk.now_ns - began) == pytest.approx(5.0, abs=0.05)


# Verification: enough frames in a row, and only those exposed since.


def _verify(desk: Desk, frames: str) -> list[Phase]:
    """Show a new frame at each instant: ``g`` seated, ``b`` 5 mm to the side, ``y`` 3 deg askew."""
    shown = {
        "g": desk.at(0.0),
        "b": desk.at(0.0, 0.005),
        "y": desk.at(0.0, 0.0, math.radians(3.0)),
    }
    return [desk.ask(shown[frame], closed=True).phase for frame in frames]


@pytest.mark.parametrize("frames", [1, 2, 3, 5])
def test_as_many_frames_in_a_row_as_commanded_have_to_agree(facts: DockSetup, frames: int) -> None:
    desk = Desk(facts, tuning=PhaseTuning(frames=frames))
    desk.to_lock()
    # Closed in the dark: the estimate at hand is older than the phase.
    dark = desk.now_ns
    action = desk.ask(
        desk.at(0.0), exposed_ns=dark, closed=True, lock=(LockPosition.CLOSED, desk.now_ns + DT_NS)
    )
    assert action.phase is Phase.VERIFY
    assert _verify(desk, "g" * frames) == [Phase.VERIFY] * (frames - 1) + [Phase.DONE]


def test_a_unit_that_is_seen_seated_says_how_large_a_gap_it_would_have_seen(desk: Desk) -> None:
    """By two more standard deviations of 1 mm than are granted: sight shows such a gap 39 times of 40."""
    desk.to_verify()
    action = desk.ask(desk.at(0.0), closed=True)
    while action.phase is Phase.VERIFY:
        action = desk.ask(desk.at(0.0), closed=True)
    told = math.hypot(desk.spec.verify.position_m, 0.003) + 0.002
    assert f"a gap of {1e3 * told:.1f} mm would have been seen" in action.reason
    failing = Desk(desk.facts)
    failing.to_verify()
    yaw = math.radians(desk.spec.verify.yaw_deg) + 0.01
    while failing.machine.phase is Phase.VERIFY:
        action = failing.ask(failing.at(0.0, yaw=yaw), closed=True)
    off, accepted = math.degrees(yaw), math.degrees(math.hypot(yaw - 0.01, 0.003))
    assert f"heading off by {off:.1f} deg, {accepted:.1f} deg accepted" in action.reason


@pytest.mark.parametrize("bad", ["b", "y"])
def test_one_frame_that_disagrees_starts_the_count_anew(desk: Desk, bad: str) -> None:
    assert TUNING.frames == 3
    desk.to_verify()
    assert set(_verify(desk, f"gg{bad}gg{bad}gg")) == {Phase.VERIFY}
    assert _verify(desk, "g") == [Phase.DONE]


def test_a_frame_is_counted_once_however_long_it_is_the_newest(desk: Desk) -> None:
    desk.to_verify()
    seen = desk.now_ns + DT_NS
    for _ in range(20):
        assert desk.ask(desk.at(0.0), exposed_ns=seen, closed=True).phase is Phase.VERIFY


def test_frames_that_never_agree_long_enough_open_the_lock(desk: Desk) -> None:
    desk.to_verify()
    began = desk.now_ns
    while desk.machine.phase is Phase.VERIFY:
        assert desk.now_ns - began < 1e9 * (desk.spec.verify.time_s + 0.2)
        _verify(desk, "ggb")
    assert desk.machine.phase is Phase.RETREAT
    assert desk.machine.belief.setback is FailureReason.NOT_VERIFIED


def test_a_locked_unit_that_sees_nothing_does_not_believe_that_it_is_docked(desk: Desk) -> None:
    """It waits for a view for as long as it may verify, and then says that it had none."""
    desk.to_verify()
    began, action = desk.now_ns, desk.ask(None, closed=True)
    while action.phase is Phase.VERIFY:
        assert action.twist == Twist()
        action = desk.ask(None, closed=True)
    assert seconds(desk.now_ns - began) == pytest.approx(desk.spec.verify.time_s, abs=0.05)
    assert (action.phase, action.reason) == (Phase.RETREAT, "locked, but not seen")
    assert desk.machine.belief.setback is FailureReason.NOT_VERIFIED


@pytest.mark.parametrize(
    ("closed", "position"),
    [(False, LockPosition.CLOSED), (True, LockPosition.OPEN), (False, LockPosition.OPEN)],
)
def test_docked_is_not_believed_with_an_open_switch_or_an_open_lock(
    desk: Desk, closed: bool, position: LockPosition
) -> None:
    """Switches or lock open at the instant after the lock has reported closed, whatever is seen."""
    desk.to_verify()
    while desk.machine.phase is Phase.VERIFY:
        assert desk.now_ns < 60e9
        desk.ask(desk.at(0.0), closed=closed, lock=(position, desk.now_ns))
    assert desk.machine.phase is Phase.RETREAT
    assert desk.machine.belief.setback is FailureReason.NOT_VERIFIED


# The tug test: what is seen before and after the wheels have pulled at the closed lock.

COARSE = np.diag([16e-6, 16e-6, 4e-4])  # of 4 mm and 1.1 deg: a gap of 20 mm is seen, half a pin is not


def _to_tug(desk: Desk, covariance: np.ndarray = COARSE) -> None:
    desk.to_verify()
    while desk.machine.phase is Phase.VERIFY:
        action = desk.ask(desk.at(0.0), covariance=covariance, closed=True)
    assert (action.phase, action.lock) == (Phase.TUG_TEST, True)
    assert "would have been seen" in action.reason


def _tug(desk: Desk, seen: SE2, **more: Any) -> Action:
    """Let the unit tug and see what becomes of it; the wheels are at rest at once."""
    action = desk.ask(seen, covariance=COARSE, closed=True, **more)
    while action.phase is Phase.TUG_TEST:
        assert desk.now_ns < 60e9
        action = desk.ask(seen, covariance=COARSE, closed=True, **more)
    return action


@pytest.mark.parametrize(
    ("sigma", "tug_m", "tugs"), [(0.0005, 0.03, False), (0.004, 0.03, True), (0.004, 0.0, False)]
)
def test_a_unit_that_would_not_see_pins_half_out_of_the_holes_tugs(
    facts: DockSetup, sigma: float, tug_m: float, tugs: bool
) -> None:
    desk = Desk(facts, spec=DockingSpec(verify=VerifySpec(tug_m=tug_m)))
    desk.to_verify()
    while desk.machine.phase is Phase.VERIFY:
        desk.ask(desk.at(0.0), covariance=np.diag([sigma**2, sigma**2, 1e-6]), closed=True)
    assert desk.machine.phase is (Phase.TUG_TEST if tugs else Phase.DONE)


@pytest.mark.parametrize(
    ("gap", "lateral", "yaw", "held"),
    [(0.0, 0.0, 0.0, True), (-0.02, 0.01, 0.1, True), (0.009, 0.0, 0.0, True), (0.011, 0.0, 0.0, False)],
)
def test_a_unit_is_held_that_is_not_seen_to_move_by_a_third_of_the_tug(
    desk: Desk, gap: float, lateral: float, yaw: float, held: bool
) -> None:
    """However uncertain both views are: most of what makes them so is the same in both."""
    assert desk.spec.verify.tug_m == 0.03
    _to_tug(desk)
    began = desk.now_ns
    action = _tug(desk, desk.at(gap, lateral, yaw))
    assert action.phase is (Phase.DONE if held else Phase.RETREAT)
    if not held:
        tug_s = desk.spec.verify.tug_m / desk.spec.press_mps
        most_s = tug_s + TUNING.settle_s + desk.spec.verify.time_s
        assert seconds(desk.now_ns - began) == pytest.approx(most_s, abs=0.1)
        assert "seen to move by 11.0 mm in a tug test" in action.reason
        assert desk.machine.belief.setback is FailureReason.NOT_VERIFIED


@pytest.mark.parametrize("latency_s", [0.0, 1.5])
@pytest.mark.parametrize("press_mps", [0.01, 0.05, 0.4])
@pytest.mark.parametrize(
    "changes",
    [{}, {"v_close_mps": 0.01}, {"a_max_mps2": 0.02}, {"kappa_per_s": 0.5}, {"kappa_per_s": 0.1}],
    ids=str,
)
def test_a_unit_that_nothing_holds_is_seen_to_move_whatever_its_drive(
    facts: DockSetup, changes: dict[str, float], press_mps: float, latency_s: float
) -> None:
    """It counted as held where the drive, which had pressed, made too little of the way."""
    limits = facts.limits.model_copy(update=changes)
    spec = DockingSpec(press_mps=press_mps, verify=VerifySpec(time_s=1.0))
    desk = Desk(replace(facts, limits=limits, link_latency_s=latency_s), spec=spec)
    desk.to_verify()
    drive = nested_limiter(limits.v_max_mps, limits.a_max_mps2, limits.kappa_per_s, 1e-9 * DT_NS)
    v, gap, sent = press_mps, 0.0, [press_mps] * round(1e9 * latency_s / DT_NS)
    while desk.machine.phase in (Phase.VERIFY, Phase.TUG_TEST):
        assert desk.now_ns < 120e9
        action = desk.ask(desk.at(gap), covariance=COARSE, closed=True, twist=Twist(v, 0.0))
        sent.append(max(-limits.v_close_mps, min(limits.v_close_mps, action.twist.v)))
        v = drive(v, sent.pop(0))
        gap += max(-v, 0.0) * 1e-9 * DT_NS  # what plugs the port lets it go back alone
    assert desk.machine.phase is Phase.RETREAT
    assert "seen to move" in action.reason
    assert gap < 2.0 * spec.verify.tug_m


def test_frames_exposed_while_the_wheels_still_turn_say_nothing(desk: Desk) -> None:
    """A drive that lags: it moves the unit after the command to stop."""
    _to_tug(desk)
    tug_s = desk.spec.verify.tug_m / desk.spec.press_mps
    for _ in range(round(50 * (tug_s + 1.0))):
        action = desk.ask(desk.at(0.0), covariance=COARSE, closed=True, twist=Twist(-0.01, 0.0))
        assert action.phase is Phase.TUG_TEST
    for _ in range(round(50 * (TUNING.settle_s + 0.4))):  # frames of before the stop arrive late
        late_ns = desk.now_ns - 500_000_000
        action = desk.ask(desk.at(0.0), exposed_ns=late_ns, covariance=COARSE, closed=True)
        assert action.phase is Phase.TUG_TEST
    assert _tug(desk, desk.at(0.0)).phase is Phase.DONE


def test_a_unit_that_gets_no_picture_after_a_tug_names_the_key_that_gives_it_time(desk: Desk) -> None:
    _to_tug(desk)
    action = _tug(desk, desk.at(0.0), exposed_ns=desk.now_ns)
    assert action.phase is Phase.RETREAT
    key = f"docking.verify.time_s = {desk.spec.verify.time_s:g}"
    assert (
        action.reason == f"locked, but seen in 0 of the 3 frames for which {key} has to be enough after a tug"
    )


def test_a_unit_tugs_when_a_picture_of_what_is_behind_it_arrives(facts: DockSetup) -> None:
    """What the collision monitor knew before may be too long ago to let it drive backwards at all."""
    desk = Desk(facts, assembler=_InPlace())
    _to_tug(desk)
    began = desk.now_ns
    for _ in range(10):
        action = desk.ask(desk.at(0.0), covariance=COARSE, closed=True, overhead_ns=began)
        assert (action.phase, action.twist) == (Phase.TUG_TEST, Twist())
    tugs = desk.ask(desk.at(0.0), covariance=COARSE, closed=True, overhead_ns=began + 1)
    assert (tugs.phase, tugs.twist) == (Phase.TUG_TEST, Twist(-desk.spec.press_mps))


@pytest.mark.parametrize("away", [False, True])
def test_seat_switches_that_were_closed_away_from_the_port_are_not_believed(desk: Desk, away: bool) -> None:
    """A unit whose switches are stuck stopped short of its seat, where sight alone did not show it."""
    desk.to_dock()
    for gap in (0.3, 0.1, 0.05):
        desk.ask(desk.at(gap), closed=away)
    began = desk.now_ns
    action = desk.ask(desk.at(0.002), closed=True)
    while action.phase is Phase.DOCK:
        assert action.twist.v == (desk.spec.press_mps if away else 0.0)
        action = desk.ask(desk.at(0.002), closed=True)
    assert (seconds(desk.now_ns - began) > desk.spec.stall_time_s) is away
    action = desk.ask(desk.at(0.002), closed=True, lock=(LockPosition.CLOSED, desk.now_ns + DT_NS))
    while action.phase is Phase.VERIFY:
        action = desk.ask(desk.at(0.002), closed=True)
    assert action.phase is (Phase.TUG_TEST if away else Phase.DONE)
    assert ("the seat switches tell nothing" in action.reason) is away


@pytest.mark.parametrize(
    ("closed_at", "turned_deg", "rests_at", "early"),
    [
        (0.0025, 0.0, 0.0, False),
        (0.0045, 0.0, 0.001, True),
        (0.0045, 0.0, 0.003, False),
        (0.0025, 3.0, 0.0, True),  # one of the pins, 40 mm aside, was at 4.6 mm, and the other one at 0.4
        (0.0025, -3.0, 0.0, True),
        (0.0025, 0.5, 0.0, False),
    ],
)
def test_a_pin_that_went_on_by_more_than_its_switch_travels_may_be_out_of_reach_of_the_lock(
    desk: Desk, closed_at: float, turned_deg: float, rests_at: float, early: bool
) -> None:
    """Switches that closed 5 mm too early let the lock close on nothing where sight did not show it."""
    desk.to_dock()
    yaw = math.radians(turned_deg)
    for closed, gap in ((True, 0.006), (False, 0.006), (True, closed_at)):  # the first one is a bounce
        assert desk.ask(desk.at(gap, yaw=yaw), closed=closed).phase is Phase.DOCK
    while desk.machine.phase is Phase.DOCK:
        desk.ask(desk.at(rests_at), closed=True)
    action = desk.ask(desk.at(rests_at), closed=True, lock=(LockPosition.CLOSED, desk.now_ns + DT_NS))
    while action.phase is Phase.VERIFY:
        action = desk.ask(desk.at(rests_at), closed=True)
    assert action.phase is (Phase.TUG_TEST if early else Phase.DONE)
    assert ("the seat switches tell nothing" in action.reason) is early


@pytest.mark.parametrize(("gap", "closed"), [(0.011, True), (0.0, False)])
def test_a_unit_that_was_not_held_presses_on_in_the_next_attempt(
    desk: Desk, gap: float, closed: bool
) -> None:
    """Its switches had closed before its pins were in reach of the lock, and did so in each attempt."""
    _to_tug(desk)
    while desk.machine.phase is Phase.TUG_TEST:
        desk.ask(desk.at(gap), covariance=COARSE, closed=closed)
    desk.ask(desk.at(0.2), closed=False, lock=(LockPosition.OPEN, desk.now_ns + DT_NS))
    while desk.machine.phase is not Phase.DOCK:
        assert desk.machine.phase in (Phase.RETREAT, Phase.HAND_OVER)
        desk.ask(desk.at(desk.spec.retreat_m), closed=False)
    for _ in range(10):
        action = desk.ask(desk.at(0.002), closed=True)
        assert action.twist.v == desk.spec.press_mps * TUNING.slower_share


def test_a_tug_is_measured_by_what_the_collision_monitor_passes(desk: Desk) -> None:
    """Half the speed takes twice the time; nothing for as long as it may take ends the attempt."""
    times = {}
    for share in (1.0, 0.5):
        slow = Desk(desk.facts)
        _to_tug(slow)
        began, v = slow.now_ns, -share * slow.spec.press_mps
        while slow.ask(slow.at(0.0), covariance=COARSE, closed=True, passed=Twist(v, 0.0)).twist.v < 0.0:
            pass
        times[share] = seconds(slow.now_ns - began)
    assert times[1.0] == pytest.approx(desk.spec.verify.tug_m / desk.spec.press_mps, abs=0.05)
    assert times[0.5] == pytest.approx(2.0 * times[1.0], abs=0.05)
    _to_tug(desk)
    action = _tug(desk, desk.at(0.0), passed=Twist())
    assert (action.phase, desk.machine.belief.setback) == (Phase.RETREAT, FailureReason.NOT_VERIFIED)
    assert action.reason == "locked, but there was no room for a tug test"


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"closed": False}, "a seat switch has been open"),
        ({"lock": (LockPosition.OPEN, 0)}, "the lock reports open in a tug test"),
    ],
)
def test_switches_and_lock_are_watched_during_a_tug(desk: Desk, more: dict[str, Any], says: str) -> None:
    _to_tug(desk)
    while desk.machine.phase is Phase.TUG_TEST:
        action = desk.ask(desk.at(0.0), **{"covariance": COARSE, "closed": True, **more})
    assert action.phase is Phase.RETREAT
    assert says in action.reason


def test_a_unit_that_was_held_in_a_tug_test_knows_how_its_seat_looks(desk: Desk) -> None:
    """Seen 6 mm short of its seat it is docked, and no longer once it is seen as a seated unit should be."""
    desk.to_verify()
    while desk.machine.phase is not Phase.DONE:
        action = desk.ask(desk.at(0.006), closed=True)
        assert action.phase is not Phase.RETREAT
    for _ in range(50):
        desk.ask(desk.at(0.006), closed=True)
    assert desk.machine.belief.conviction is Conviction.DOCKED
    for _ in range(50):
        desk.ask(desk.at(-0.004), closed=True)
    assert desk.machine.belief.setback is FailureReason.UNSEATED


def test_who_does_not_look_is_not_docked_while_a_switch_is_open(facts: DockSetup) -> None:
    desk = Desk(facts, spec=SIGHTLESS)
    desk.to_lock()
    action = desk.ask(desk.at(0.0), closed=False, lock=(LockPosition.CLOSED, desk.now_ns + DT_NS))
    assert action.phase is Phase.VERIFY
    assert desk.ask(desk.at(0.0), closed=True).phase is Phase.DONE


def _docked(facts: DockSetup, spec: DockingSpec | None = None) -> Desk:
    desk = Desk(facts, spec=spec or DockingSpec())
    desk.to_verify()
    while desk.machine.phase is not Phase.DONE:
        assert desk.now_ns < 60e9
        desk.ask(desk.at(0.0), closed=True)
    assert desk.machine.belief.conviction is Conviction.DOCKED
    return desk


@pytest.mark.parametrize(
    ("gap", "closed", "position", "failure", "says"),
    [
        (0.0, True, LockPosition.OPEN, FailureReason.LOCK_OPENED, "the lock reports open"),
        (0.0, True, LockPosition.CLOSING, FailureReason.LOCK_OPENED, "the lock reports closing"),
        (0.0, False, LockPosition.CLOSED, FailureReason.UNSEATED, "a seat switch has been open"),
        (0.1, True, LockPosition.CLOSED, FailureReason.UNSEATED, "seen off its seat at 100.0 mm"),
    ],
)
def test_the_belief_of_a_docked_unit_ends_with_its_evidence(
    facts: DockSetup, gap: float, closed: bool, position: LockPosition, failure: FailureReason, says: str
) -> None:
    """A lock that opens later, switches that open, a unit that is pulled 10 cm away: each alone is enough."""
    desk = _docked(facts)
    for _ in range(50):
        desk.ask(desk.at(0.0), closed=True)
    assert desk.machine.belief.conviction is Conviction.DOCKED
    lost = desk.now_ns
    while desk.machine.belief.conviction is Conviction.DOCKED:
        assert desk.now_ns - lost < 0.2e9
        action = desk.ask(desk.at(gap), closed=closed, lock=(position, desk.now_ns))
    assert (action.phase, action.twist, action.lock) == (Phase.DONE, Twist(), True)
    belief = desk.machine.belief
    assert (belief.conviction, belief.setback) == (Conviction.UNDECIDED, failure)
    assert says in belief.reason
    for _ in range(50):  # it does not come back by itself
        desk.ask(desk.at(0.0), closed=True, lock=(LockPosition.CLOSED, desk.now_ns))
    assert desk.machine.belief == belief


def test_a_bounce_of_a_switch_does_not_end_the_belief(facts: DockSetup) -> None:
    desk = _docked(facts)
    for _ in range(10):
        for closed in (False, False, True):
            desk.ask(desk.at(0.0), closed=closed)
    assert desk.machine.belief.conviction is Conviction.DOCKED


# Undocking, and any retreat: the unit has to part from the port, not only to spend its time.


@pytest.mark.parametrize("seen", [True, False])
@pytest.mark.parametrize("position", [LockPosition.CLOSED, LockPosition.CLOSING])
def test_undocking_with_a_jammed_lock_is_no_undocking(
    facts: DockSetup, position: LockPosition, seen: bool
) -> None:
    """The unit does not pull at a closed lock: it would drag along the unit that the lock holds."""
    desk = _docked(facts)
    desk.machine.undock()
    began = desk.now_ns
    while not desk.machine.finished or desk.now_ns == began:
        assert desk.now_ns - began < 15e9
        exposed = None if seen else began
        action = desk.ask(desk.at(0.0), exposed_ns=exposed, closed=True, lock=(position, desk.now_ns))
        assert action.twist == Twist()
    belief = desk.machine.belief
    assert (belief.conviction, belief.setback) == (Conviction.GAVE_UP, FailureReason.NOT_RELEASED)
    assert f"the lock reports {position.value}" in belief.reason


@pytest.mark.parametrize(
    ("v_close_mps", "lock_delay_s"), [(0.3, 0.0), (0.02, 0.0), (0.3, 2.5)], ids=["usual", "slow", "late"]
)
def test_a_unit_that_begins_docked_has_to_back_out_before_it_is_undocked(
    facts: DockSetup, v_close_mps: float, lock_delay_s: float
) -> None:
    """Nothing is seen before the unit has left: its wheels tell the way.

    A unit that may only go slowly, or hears late that its lock is open, was out of time before it was out of
    the port.
    """
    limits = facts.limits.model_copy(update={"v_close_mps": v_close_mps})
    facts = replace(facts, limits=limits, lock_delay_s=lock_delay_s)
    desk = Desk(facts)
    law = build_controller(Choice(name="c1"), facts)
    desk.machine = PhaseMachine(desk.spec, facts, law, docked=True)
    desk.machine.undock()
    way, twist = 0.0, Twist()
    while not desk.machine.finished or way == 0.0:
        assert desk.now_ns < 40e9
        open_ns = round(1e9 * (TUNING.unlatch_s + lock_delay_s - 0.1)) if lock_delay_s else 0
        position = LockPosition.OPEN if desk.now_ns >= open_ns else LockPosition.CLOSED
        twist = desk.ask(None, closed=way < 1e-3, lock=(position, desk.now_ns), twist=twist).twist
        assert twist.v >= -v_close_mps
        way -= 0.02 * twist.v
    assert desk.machine.belief.conviction is Conviction.UNDOCKED
    assert way == pytest.approx(desk.spec.retreat_m, abs=0.02)


def test_a_unit_whose_lock_never_says_a_word_is_not_undocked(facts: DockSetup) -> None:
    desk = Desk(facts)
    law = build_controller(Choice(name="c1"), facts)
    desk.machine = PhaseMachine(desk.spec, facts, law, docked=True)
    desk.machine.undock()
    while desk.now_ns == 0 or not desk.machine.finished:
        assert desk.now_ns < 15e9
        desk.ask(desk.at(desk.spec.retreat_m), closed=False)
    assert desk.machine.belief.setback is FailureReason.NOT_RELEASED
    assert "the lock reports nothing" in desk.machine.belief.reason


@pytest.mark.parametrize(("switches", "share"), [(True, 1.0), (False, 0.5), (False, 0.0)])
def test_undocking_needs_open_switches_and_the_whole_way(
    facts: DockSetup, switches: bool, share: float
) -> None:
    desk = _docked(facts)
    desk.machine.undock()
    began = desk.now_ns
    while not desk.machine.finished or desk.now_ns == began:
        assert desk.now_ns - began < 15e9
        gap = share * desk.spec.retreat_m
        desk.ask(desk.at(gap), closed=switches, lock=(LockPosition.OPEN, desk.now_ns))
    assert desk.machine.belief.setback is FailureReason.NOT_RELEASED


def test_undocked_unseen_by_odometry_with_the_lock_open(facts: DockSetup) -> None:
    desk = _docked(facts)
    desk.machine.undock()
    began, gap = desk.now_ns, 0.0
    while not desk.machine.finished or desk.now_ns == began:
        assert desk.now_ns - began < 15e9
        action = desk.ask(
            desk.at(gap), exposed_ns=began, closed=gap < 1e-3, lock=(LockPosition.OPEN, desk.now_ns)
        )
        assert not action.lock  # nor once it has undocked: the next port would find the lock closed
        gap -= 0.02 * action.twist.v
    assert desk.machine.belief.conviction is Conviction.UNDOCKED


def test_a_lock_that_was_closed_before_it_was_told_to_is_named(facts: DockSetup) -> None:
    """It has jammed in the attempt before, and tells of changes only."""
    desk = Desk(facts)
    desk.to_lock()
    closed_ns, action = desk.now_ns - 1_000_000_000, None
    while action is None or action.phase is Phase.LOCK:
        action = desk.ask(desk.at(0.0), closed=True, lock=(LockPosition.CLOSED, closed_ns))
    assert action.reason == "cam closed before the command to close, and has not opened since"


@pytest.mark.parametrize("seen", [True, False])
def test_a_retreat_that_cannot_part_from_the_port_ends_the_step(facts: DockSetup, seen: bool) -> None:
    """The lock jams while it closes: two attempts are left, but the unit cannot leave the first."""
    desk = Desk(facts)
    desk.to_lock()
    began, gap = desk.now_ns, 0.0
    while not desk.machine.finished:
        assert desk.now_ns - began < 20e9
        exposed = None if seen else began
        lock = (LockPosition.CLOSING, desk.now_ns)
        action = desk.ask(desk.at(0.0 if seen else gap), exposed_ns=exposed, closed=True, lock=lock)
        gap -= 0.02 * min(action.twist.v, 0.0)
    belief = desk.machine.belief
    assert (desk.machine.attempt, belief.conviction) == (1, Conviction.GAVE_UP)
    assert belief.setback is FailureReason.NOT_RELEASED
    assert "stuck" in belief.reason
    assert "cam not closed" in belief.reason, "why it backed out in the first place"


def test_a_unit_that_nobody_sees_and_that_has_not_driven_off_is_stuck_in_the_port(facts: DockSetup) -> None:
    desk = Desk(facts)
    desk.to_dock()
    while desk.machine.phase is Phase.DOCK:
        desk.ask(desk.at(0.005), lock=(LockPosition.OPEN, desk.now_ns))
    seen_ns = desk.now_ns
    while desk.machine.attempt == 1 and not desk.machine.finished:
        assert desk.now_ns < 60e9
        desk.ask(desk.at(0.005), exposed_ns=seen_ns, lock=(LockPosition.OPEN, desk.now_ns))
    assert desk.machine.belief.setback is FailureReason.NOT_RELEASED
    assert "5 mm away by odometry" in desk.machine.belief.reason


def test_a_unit_that_is_seen_clear_of_the_port_has_left_it_whatever_the_lock_says(facts: DockSetup) -> None:
    """The lock jams while it closes, and pins that it does not hold come out."""
    desk = Desk(facts)
    desk.to_lock()
    gap = 0.0
    while desk.machine.attempt == 1 and not desk.machine.finished:
        assert desk.now_ns < 40e9
        action = desk.ask(desk.at(gap), closed=gap < 1e-3, lock=(LockPosition.CLOSING, desk.now_ns))
        gap -= 0.02 * min(action.twist.v, 0.0)
    assert desk.machine.attempt == 2


@pytest.mark.parametrize(("lateral", "parted"), [(0.010, False), (0.021, True), (0.5, True)])
def test_only_a_unit_before_the_mouths_can_be_stuck_in_them(
    facts: DockSetup, lateral: float, parted: bool
) -> None:
    """What keeps it from backing out is not the port: pins that far to a side are in no hole of 15 mm."""
    desk = Desk(facts)
    desk.to_dock()
    while desk.machine.attempt == 1 and not desk.machine.finished:
        assert desk.now_ns < 60e9
        desk.ask(desk.at(-0.056, lateral), lock=(LockPosition.OPEN, desk.now_ns))
    assert (desk.machine.attempt == 2) is parted
    assert (desk.machine.belief.setback is FailureReason.NOT_RELEASED) is not parted


@pytest.mark.parametrize(("state", "parted"), [(MonitorState.STOP, True), (MonitorState.FREE, False)])
def test_a_unit_that_the_monitor_holds_in_the_port_is_not_stuck_there(
    facts: DockSetup, state: MonitorState, parted: bool
) -> None:
    """At the end of its retreat it commands to stand still, which no monitor limits."""
    desk, action = Desk(facts), None
    desk.to_dock()
    while desk.machine.attempt == 1 and not desk.machine.finished:
        assert desk.now_ns < 60e9
        limits = action is not None and action.twist != Twist()
        monitor = CollisionMonitorState(desk.now_ns, state if limits else MonitorState.FREE, None, None, 0.0)
        action = desk.ask(desk.at(0.005), lock=(LockPosition.OPEN, desk.now_ns), monitor=monitor)
    assert (desk.machine.attempt == 2) is parted


# The retreat: how long the unit waits for an overhead picture before it backs out.


#: The exposure time of the newest overhead picture, from the time and the time of the decision to back out.
Pictures = Callable[[int, int], int | None]


class _InPlace:
    """A long-distance phase that finds the unit where it should be, after some instants."""

    progress = path = None

    def __init__(self, instants: int = 0) -> None:
        self.instants = instants

    def reset(self, reason: str) -> None: ...

    def step(self, observation: Observation) -> Twist | None:
        self.instants -= 1
        return Twist() if self.instants >= 0 else None


def waited_s(
    facts: DockSetup, pictures: Pictures, overhead: bool = True, lock_opens_s: float = 0.0
) -> tuple[float, float]:
    """Return how long a unit that stalled before the port stands in its retreat, and how long that lasts."""
    law = build_controller(Choice(name="c1"), facts)
    spec = DockingSpec(attempts=1)
    machine = PhaseMachine(spec, facts, law, _InPlace() if overhead else None)
    X_DU = SE2(-facts.offset - 0.05, 0.0, 0.0)
    began, moved, now = -1, -1, 0
    while not machine.finished:
        now += DT_NS
        seen = pictures(now, began if began >= 0 else now)
        is_open = (seconds(now - began) if began >= 0 else 0.0) >= lock_opens_s
        lock = LockFeedback("a", now, LockPosition.OPEN if is_open else LockPosition.CLOSING)
        pose = PoseEstimate(now, X_DU, np.diag([1e-6, 1e-6, 1e-6]), now)
        action = machine.step(Observation(now, pose, lock=lock, overhead_exposed_ns=seen))
        if action.phase is Phase.RETREAT:
            began = now if began < 0 else began
            moved = now if moved < 0 and action.twist.v < 0.0 else moved
    assert 0 < began <= moved
    return seconds(moved - began), seconds(now - began)


@pytest.mark.parametrize("late_s", [0.04, 0.16, 0.5])
def test_it_goes_when_a_picture_of_after_the_decision_arrives(facts: DockSetup, late_s: float) -> None:
    def pictures(now_ns: int, decided_ns: int) -> int | None:
        """One a tick after the decision, so late; up to then one from the instant of the decision itself."""
        return decided_ns + 1 if now_ns >= decided_ns + round(1e9 * late_s) else decided_ns

    waited, _ = waited_s(facts, pictures)
    assert waited == pytest.approx(late_s, abs=1e-9)


@pytest.mark.parametrize("pictures", [lambda now, decided: None, lambda now, decided: 0], ids=["none", "old"])
def test_it_goes_when_no_picture_comes(facts: DockSetup, pictures: Pictures) -> None:
    waited, lasted = waited_s(facts, pictures)
    assert waited == pytest.approx(TUNING.look_around_s + 1e-9 * DT_NS, abs=1e-9)
    # The unit is held where it is, as by the collision monitor: the time for the way counts from where it may
    # go.
    speed = TUNING.retreat.speed_mps
    way_s = DockingSpec().retreat_m / speed + speed / facts.limits.a_max_mps2 + TUNING.retreat_margin_s
    assert lasted == pytest.approx(waited + way_s + TUNING.settle_s, abs=4e-9 * DT_NS)


def test_a_scene_without_an_overhead_camera_has_nothing_to_wait_for(facts: DockSetup) -> None:
    assert waited_s(facts, lambda now, decided: None, overhead=False)[0] == 0.0


def test_the_lock_has_to_be_open_as_well(facts: DockSetup) -> None:
    waited, _ = waited_s(facts, lambda now, decided: now, lock_opens_s=0.4)
    assert waited == pytest.approx(0.4, abs=1e-9)
