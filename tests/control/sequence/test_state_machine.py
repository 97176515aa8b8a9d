"""The phase machine against a toy robot: every way through its states, and the belief at the end."""

import numpy as np
import pytest

from msrr_control.docking.controller import build_controller
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.context import Transition
from msrr_control.sequence.observation import GiveUp, Observation
from msrr_control.sequence.state_machine import STATES, PhaseMachine
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    AssemblyProgress,
    Conviction,
    FailureReason,
    LosStatus,
    Phase,
    SeatSwitches,
    Twist,
)
from msrr_scenes.specs.control import DockingSpec, VerifySpec
from msrr_scenes.specs.spec import Choice

STRAIGHT = [Phase.DOCK, Phase.LOCK, Phase.VERIFY, Phase.DONE]
BLIND_TRUST = DockingSpec(verify=VerifySpec(by_sight=False))


@pytest.mark.parametrize("name", ["c1", "linear"])
@pytest.mark.parametrize("seed", [None, 1])
def test_it_docks(toy, name: str, seed: int | None) -> None:
    rng = None if seed is None else np.random.default_rng(seed)
    robot = toy(controller=Choice(name=name), rng=rng)
    last = robot.run()
    assert robot.phases() == STRAIGHT
    assert robot.machine.belief.conviction is Conviction.DOCKED
    assert (last.lock, last.twist, last.attempt) == (True, Twist(), 1)
    assert robot.now_ns < 10e9


def test_every_start_of_the_set_docks(toy, facts: DockSetup) -> None:
    rng = np.random.default_rng(2)
    for _ in range(12):
        x, y, yaw = rng.uniform([-0.85, -0.1, -0.3], [-0.75, 0.1, 0.3])
        robot = toy(X_DU=SE2(x, y, yaw), rng=rng)
        robot.run()
        assert robot.machine.belief.conviction is Conviction.DOCKED, robot.machine.belief


def test_a_marker_out_of_view_is_searched_for(toy) -> None:
    robot = toy(X_DU=SE2(-0.8, 0.0, 1.2))
    robot.run()
    assert robot.phases() == [Phase.HAND_OVER, *STRAIGHT]
    assert all(a.twist.v == 0.0 for a in robot.log if a.phase is Phase.HAND_OVER)


def test_a_marker_that_is_never_seen(toy) -> None:
    robot = toy(blind=True)
    robot.run()
    belief = robot.machine.belief
    assert (belief.conviction, belief.setback) == (Conviction.GAVE_UP, FailureReason.NEVER_DETECTED)
    assert robot.phases() == [Phase.HAND_OVER, Phase.FAILED]
    assert robot.now_ns < 1e9 * (DockingSpec().search_time_s + 1.0)


def test_a_blocked_port_is_tried_again_from_further_away(toy) -> None:
    robot = toy(blocked_until=2)
    last = robot.run()
    assert robot.phases() == [Phase.DOCK, Phase.RETREAT, Phase.HAND_OVER, *STRAIGHT]
    again = next(a for a in robot.log if a.attempt == 2)
    assert again.phase is Phase.HAND_OVER
    assert "no progress" in again.reason
    assert last.attempt == 2
    retreat = [a for a in robot.log if a.phase is Phase.RETREAT]
    assert "no progress" in retreat[0].reason
    assert not any(a.lock for a in robot.log if a.phase in (Phase.DOCK, Phase.RETREAT))


@pytest.mark.parametrize(("attempts", "says"), [(1, "after 1 attempt:"), (2, "after 2 attempts:")])
def test_after_the_last_attempt_it_gives_up_at_a_distance(toy, attempts: int, says: str) -> None:
    robot = toy(blocked_until=99, spec=DockingSpec(attempts=attempts))
    last = robot.run()
    belief = robot.machine.belief
    assert (belief.conviction, belief.setback) == (Conviction.GAVE_UP, FailureReason.STALLED)
    assert f"gave up {says}" in belief.reason
    assert robot.gap == pytest.approx(DockingSpec().retreat_m, abs=0.02)
    assert (last.phase, last.lock, last.twist) == (Phase.FAILED, False, Twist())


def test_a_target_lost_on_the_way_is_found_again(toy) -> None:
    robot = toy()
    while robot.gap > 0.3:
        robot.step()
    robot.blind = True
    while robot.machine.phase is not Phase.HAND_OVER:
        robot.step()
    assert robot.machine.belief.setback is FailureReason.TARGET_LOST
    robot.blind = False
    assert robot.run().attempt == 2
    assert robot.machine.belief.conviction is Conviction.DOCKED


def test_a_target_lost_for_good(toy) -> None:
    robot = toy()
    while robot.gap > 0.3:
        robot.step()
    robot.blind = True
    robot.run()
    assert robot.machine.belief.setback is FailureReason.TARGET_LOST
    assert robot.gap >= 0.4
    assert robot.log[-1].attempt == 2
    assert f"its search failed {DockingSpec().attempts} times" in robot.log[-1].reason


def test_a_cam_that_does_not_close(toy) -> None:
    robot = toy(cam_jams=True, spec=DockingSpec(attempts=1))
    robot.run()
    assert robot.machine.belief.setback is FailureReason.NOT_LATCHED
    assert robot.phases() == [Phase.DOCK, Phase.LOCK, Phase.RETREAT, Phase.FAILED]


@pytest.mark.parametrize("seen_offset", [-0.0034, -0.008, 0.012])
def test_a_seated_unit_that_is_seen_off_its_seat_is_docked_by_a_tug_test(toy, seen_offset: float) -> None:
    """Seen short of its seat by more than is accepted, or beyond it, before and after the wheels pull."""
    robot = toy(seen_offset=seen_offset, spec=DockingSpec(attempts=1))
    robot.run()
    assert robot.phases() == [Phase.DOCK, Phase.LOCK, Phase.VERIFY, Phase.TUG_TEST, Phase.DONE]
    assert robot.machine.belief.conviction is Conviction.DOCKED
    assert robot.gap < 0.0025
    tug = [a for a in robot.log if a.phase is Phase.TUG_TEST]
    assert all(a.lock for a in tug)
    dt = 1.0 / robot.facts.rate_hz
    way = sum(-a.twist.v * dt for a in tug)
    assert way == pytest.approx(robot.spec.verify.tug_m, abs=1.001 * robot.spec.press_mps * dt)
    for _ in range(100):  # what it then sees is how its seat looks
        assert robot.step().phase is Phase.DONE
    assert robot.machine.belief.conviction is Conviction.DOCKED


@pytest.mark.parametrize("seen_offset", [-0.0034, -0.008, 0.012])
def test_without_a_tug_test_sight_contradicts_a_lock(toy, seen_offset: float) -> None:
    robot = toy(
        seen_offset=seen_offset, spec=DockingSpec(attempts=1, verify=VerifySpec(tug_m=0.0, time_s=0.5))
    )
    robot.run()
    assert Phase.TUG_TEST not in robot.phases()
    assert robot.machine.belief.setback in (FailureReason.NOT_VERIFIED, FailureReason.STALLED)
    trusting = toy(seen_offset=seen_offset, spec=BLIND_TRUST)
    trusting.run()
    assert trusting.machine.belief.conviction is Conviction.DOCKED


@pytest.mark.parametrize(("by_sight", "believes"), [(True, False), (False, True)])
def test_stuck_switches_fool_only_a_robot_that_does_not_look(toy, by_sight: bool, believes: bool) -> None:
    """A block holds the unit 10 mm off its seat while the switches say closed."""
    robot = toy(blocked_until=99, spec=DockingSpec(attempts=1, verify=VerifySpec(by_sight=by_sight)))
    honest = robot.observe

    def stuck() -> Observation:
        s = honest()
        return Observation(s.now_ns, s.pose, s.los, SeatSwitches("a", s.now_ns, True, True), s.lock, s.twist)

    robot.observe = stuck
    robot.run()
    assert (robot.machine.belief.conviction is Conviction.DOCKED) is believes
    assert robot.gap > 0.009
    assert (Phase.TUG_TEST in robot.phases()) is by_sight  # it was seen to move with its lock closed


def test_a_unit_that_rolls_back_at_rest_presses_on_while_the_cam_closes(toy) -> None:
    """By the backlash of its drive, in its first attempt and without losing it."""
    robot = toy(spec=DockingSpec(attempts=1))
    while not robot.machine.finished:
        assert robot.now_ns < 60e9
        if robot.step().phase is Phase.LOCK and robot.log[-1].twist == Twist():
            robot.X_DU = SE2(robot.X_DU.x - 0.0003, robot.X_DU.y, robot.X_DU.yaw)
    assert robot.phases() == [Phase.DOCK, Phase.LOCK, *STRAIGHT]
    assert robot.machine.belief.conviction is Conviction.DOCKED
    first_lock = next(k for k, a in enumerate(robot.log) if a.phase is Phase.LOCK)
    again = [a for a in robot.log[first_lock:] if a.phase in (Phase.DOCK, Phase.LOCK)]
    pressing = again[next(k for k, a in enumerate(again) if a.phase is Phase.DOCK) :]
    assert all(a.twist.v == PhaseTuning().slower_share * robot.spec.press_mps for a in pressing)
    assert all(a.twist == Twist() for a in robot.log if a.phase in (Phase.VERIFY, Phase.DONE))


def test_a_unit_that_is_pushed_out_of_its_seat_while_it_presses_tries_again(toy) -> None:
    robot = toy(spec=DockingSpec(attempts=1))
    while not robot.machine.finished:
        assert robot.now_ns < 60e9
        if robot.step().phase is Phase.LOCK:
            robot.X_DU = SE2(robot.X_DU.x - 0.002, robot.X_DU.y, robot.X_DU.yaw)
    assert robot.machine.belief.setback is FailureReason.NOT_LATCHED


def test_a_unit_that_slid_out_of_its_seat_comes_more_slowly_the_next_time(toy) -> None:
    """It presses on while it comes back with the wheels at rest, and the pins pass the holes in time."""
    robot = toy(spec=DockingSpec(attempts=4))
    spec, facts, tuning = robot.spec, robot.facts, PhaseTuning()
    seated, pressed, arrived = set(), {k: [] for k in range(1, 5)}, {k: [] for k in range(1, 5)}
    while not robot.machine.finished:
        assert robot.now_ns < 200e9
        gap, action = robot.gap, robot.step()
        if action.phase is Phase.DOCK and action.twist.v > 0.0:
            at_port = gap <= facts.pin_reach + tuning.contact_m
            (pressed if at_port else arrived)[action.attempt].append((gap, action.twist.v))
        if action.phase is Phase.LOCK and action.attempt not in seated:
            seated.add(action.attempt)
            assert action.twist == Twist()  # pressing on is no cure for the next attempt
        if action.phase is Phase.LOCK and action.attempt < 4:
            robot.X_DU = SE2(robot.X_DU.x - 0.002, robot.X_DU.y, robot.X_DU.yaw)
    assert robot.machine.belief.conviction is Conviction.DOCKED
    least = facts.pin_reach / spec.stall_time_s
    speeds = [max(v for _, v in pressed[k]) for k in range(1, 5)]
    assert speeds == pytest.approx([spec.press_mps, least, least, least])
    assert tuning.slower_share**2 * spec.press_mps < least < tuning.slower_share * spec.press_mps
    for k in (2, 3, 4):
        assert all(v <= speeds[k - 1] + gap / tuning.slowing_s for gap, v in arrived[k])
    assert max(v for _, v in arrived[2]) > 0.09  # far from the port as fast as ever


def test_undocking_opens_the_lock_before_it_moves(toy) -> None:
    robot = toy()
    with pytest.raises(MsrrError, match="not docked"):
        robot.machine.undock()
    robot.run()
    robot.machine.undock()
    first = robot.step()
    assert (first.phase, first.lock, first.twist) == (Phase.RETREAT, False, Twist())
    robot.run()
    assert robot.machine.belief.conviction is Conviction.UNDOCKED
    assert robot.gap == pytest.approx(DockingSpec().retreat_m, abs=0.02)
    with pytest.raises(MsrrError, match="not docked"):
        robot.machine.undock()


def test_it_presses_no_harder_than_commanded(toy) -> None:
    robot = toy(blocked_until=99, spec=DockingSpec(attempts=1, press_mps=0.03))
    pressed = []
    while robot.machine.phase is not Phase.RETREAT:
        gap = robot.gap
        action = robot.step()
        if action.phase is Phase.DOCK and gap < robot.facts.pin_reach:
            pressed.append(action.twist.v)
    assert set(pressed) == {0.03}


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_controller_that_commands_no_number_is_misuse(toy, value: float) -> None:
    class Broken:
        def reset(self, inputs) -> None: ...
        def step(self, inputs) -> Twist:
            return Twist(value, 0.0)

    robot = toy()
    robot.machine = PhaseMachine(robot.spec, robot.facts, Broken())
    with pytest.raises(MsrrError, match="commanded"):
        robot.step()


def test_a_controller_that_commands_too_much_is_limited(toy, facts: DockSetup) -> None:
    class Wild:
        def reset(self, inputs) -> None: ...
        def step(self, inputs) -> Twist:
            return Twist(1e9, -1e9)

    robot = toy()
    robot.machine = PhaseMachine(robot.spec, robot.facts, Wild())
    assert robot.step().twist == Twist(facts.limits.v_close_mps, -facts.limits.w_max_radps)


def test_the_same_observations_give_the_same_actions(toy) -> None:
    a, b = (toy(rng=np.random.default_rng(4), blocked_until=2) for _ in range(2))
    a.run()
    b.run()
    assert a.log == b.log


def test_random_observations_never_break_it(toy) -> None:
    """Estimates, sight, switches and lock come and go at random: always an action within the limits."""
    rng = np.random.default_rng(9)
    for _ in range(10):
        robot = toy(spec=DockingSpec(attempts=3))
        for _ in range(600):
            robot.blind = bool(rng.random() < 0.3)
            robot.blocked_until = int(rng.integers(0, 5))
            robot.cam_jams = bool(rng.random() < 0.2)
            robot.seen_offset = float(rng.normal(0.0, 0.01))
            action = robot.step()
            assert abs(action.twist.v) <= robot.facts.limits.v_close_mps
            assert abs(action.twist.w) <= robot.facts.limits.w_max_radps
            assert action.reason
            if action.lock:
                assert action.phase in (Phase.LOCK, Phase.VERIFY, Phase.DONE)


def test_a_whole_decision_is_fast(toy, cost_s) -> None:
    robot = toy()
    robot.step()
    observation = robot.observe()
    assert observation.los is not None
    assert observation.los.status is LosStatus.SEEN
    assert cost_s(lambda: robot.machine.step(observation)) < 2e-4


class _Scripted:
    """An assembler that returns scripted decisions and counts its resets."""

    path = None

    def __init__(self, *decisions: Twist | GiveUp | None) -> None:
        self.decisions, self.resets = list(decisions), list[str]()
        self.progress: AssemblyProgress | None = None

    def reset(self, reason: str) -> None:
        self.resets.append(reason)

    def step(self, observation: Observation) -> Twist | GiveUp | None:
        at, stamp_ns = (0.0, 0.0), observation.now_ns
        self.progress = AssemblyProgress(
            stamp_ns, "turn", 1, at, at, at, 0.0, 1.0, 1.0, None, "held by a post"
        )
        return self.decisions.pop(0) if self.decisions else None


def _with(robot, assembler: _Scripted, spec: DockingSpec | None = None) -> None:
    robot.machine = PhaseMachine(
        spec or DockingSpec(), robot.facts, build_controller(robot.controller, robot.facts), assembler
    )


def test_the_phase_machine_assembles_first(toy) -> None:
    robot = toy()
    _with(robot, _Scripted(Twist(0.35, 0.0), Twist(0.0, 0.1)))
    first = robot.step()
    assert (first.phase, first.twist) == (Phase.ASSEMBLE, Twist(0.35, 0.0))
    assert first.reason == "turn: held by a post"
    assert "held by a post" not in robot.run().reason
    assert robot.phases() == [Phase.ASSEMBLE, *STRAIGHT]
    assert sum(a.phase is Phase.ASSEMBLE for a in robot.log) == 2


def test_the_phase_machine_gives_up_with_its_assembler(toy) -> None:
    robot = toy()
    _with(robot, _Scripted(Twist(), GiveUp(FailureReason.BLOCKED, "a fence")))
    robot.run()
    assert robot.phases() == [Phase.ASSEMBLE, Phase.FAILED]
    assert (robot.machine.belief.setback, robot.machine.belief.reason) == (FailureReason.BLOCKED, "a fence")


def test_a_failed_hand_over_goes_back_to_assembly(toy) -> None:
    robot, assembler = toy(blind=True), _Scripted()
    _with(robot, assembler)
    while not assembler.resets:
        robot.step()
    assert "no marker seen" in assembler.resets[0]
    robot.blind = False
    last = robot.run()
    assert (last.phase, last.attempt) == (Phase.DONE, 1)


def test_a_marker_that_is_never_seen_is_looked_for_as_often_as_there_are_attempts(toy) -> None:
    robot, assembler = toy(blind=True), _Scripted()
    _with(robot, assembler, DockingSpec(attempts=2))
    robot.run()
    assert robot.machine.belief.setback is FailureReason.NEVER_DETECTED
    assert len(assembler.resets) == 1
    assert robot.log[-1].attempt == 1
    assert "gave up after its search failed 2 times: no marker seen" in robot.log[-1].reason


@pytest.mark.parametrize(("read_from_m", "searches"), [(0.65, 2), (0.55, 3), (0.4, None)])
def test_a_marker_that_was_not_read_is_looked_for_from_nearer(
    toy, read_from_m: float, searches: int | None
) -> None:
    """But only up to where an attempt begins again: the unit does not know where the port is."""
    robot, assembler = toy(X_DU=SE2(-0.8, 0.0, 0.0)), _Scripted()
    _with(robot, assembler, DockingSpec(attempts=5))
    while not robot.machine.finished:
        robot.blind = robot.gap > read_from_m
        robot.step()
    if searches is None:
        assert robot.machine.belief.setback is FailureReason.NEVER_DETECTED
        assert robot.gap > robot.spec.retreat_m
    else:
        assert (robot.machine.phase, robot.log[-1].attempt) == (Phase.DONE, 1)
        assert len(assembler.resets) == searches - 1


def test_the_table_of_states_is_whole() -> None:
    assert set(STATES) == set(Phase)
    assert all(set(state.leads_to) <= set(Phase) for state in STATES.values())
    assert {phase for phase, state in STATES.items() if not state.leads_to} == {Phase.DONE, Phase.FAILED}


def test_a_transition_that_the_table_does_not_have_is_an_error(toy, monkeypatch: pytest.MonkeyPatch) -> None:
    leap = STATES[Phase.DOCK]._replace(act=lambda context: Transition(Phase.DONE, "wishful thinking"))
    monkeypatch.setitem(STATES, Phase.DOCK, leap)
    with pytest.raises(RuntimeError, match="no transition from"):
        toy().run()
