"""What outlasts a decision of the phase machine: timers, the memory of a stay, and the last known gap."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_control.docking.controller import build_controller
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.aim import Aim
from msrr_control.sequence.context import DockingContext
from msrr_control.sequence.observation import Observation
from msrr_control.sequence.state_memory import HoldTimer, StateMemory
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import PoseEstimate, Twist
from msrr_scenes.specs.control import DockingSpec
from msrr_scenes.specs.spec import Choice

S = 1_000_000_000


def test_a_timer_runs_while_its_condition_holds_without_a_break() -> None:
    timer = HoldTimer()
    assert [timer.update(holds, k * S) for k, holds in enumerate([False, True, True, False, True, True])] == [
        -1.0,
        0.0,
        1.0,
        -1.0,
        0.0,
        1.0,
    ]


@pytest.mark.parametrize("press_mps", [0.005, 0.02, 0.05, 0.2])
def test_a_unit_that_slips_gets_slower_but_passes_the_holes_in_the_time_that_it_has(
    facts: DockSetup, press_mps: float
) -> None:
    law, spec = build_controller(Choice(name="c1"), facts), DockingSpec(press_mps=press_mps)
    context, least = DockingContext(spec, facts, law, None, PhaseTuning(), 0.02), facts.pin_reach / 2.0
    assert (spec.stall_time_s, context.greatest_speed(0.1)) == (2.0, math.inf)
    for _ in range(5):
        before = context.press_mps
        context.slow_down()
        assert min(before, least) <= context.press_mps <= max(0.5 * before, min(before, least))
    assert context.press_mps == pytest.approx(min(press_mps, least))


@pytest.mark.parametrize("step", [0.003, 0.004, 0.006])
@pytest.mark.parametrize("port", np.linspace(-0.006, 0.006, 13).tolist())
def test_jams_lead_to_the_port_from_both_sides(step: float, port: float) -> None:
    """Holes that take pins in from 2 mm to their side are found by the third attempt, 6 mm off."""
    aim = Aim()
    tried = []
    while abs(aim.lateral - port) > 0.002:
        tried.append(aim.lateral)
        aim.jammed(step, to_left=port > aim.lateral)
    assert len(tried) <= 2
    assert aim.lateral not in tried


@pytest.mark.parametrize("closed", [(True, False), (False, True), (True, True)])
def test_a_unit_that_slid_out_aims_to_where_its_other_pin_comes_in_first(
    context: DockingContext, closed: tuple[bool, bool]
) -> None:
    """Turned by two standard deviations, then half of that if the other pin is first."""
    left, right = closed
    side, context.memory.sigma_yaw = left - right, 0.02
    tried = []
    for first in (closed, (right, left)):
        context.reached_bottom(*first)
        context.slid()
        tried.append(context.aim.yaw)
    assert tried == pytest.approx([side * 0.04, side * 0.02])
    assert context.aim.lateral == 0.0


@pytest.mark.parametrize("first", [True, False])
def test_a_unit_that_jams_to_one_side_again_and_again_aims_at_another_heading_too(
    context: DockingContext, first: bool
) -> None:
    """Turned away from that side by two standard deviations each time, until it jams to the other one."""
    side, context.memory.sigma_yaw = 1.0 if first else -1.0, 0.02
    in_holes = SE2(-0.5 * context.setup.pin_reach - context.setup.offset, 0.0, 0.0)
    context.observe(Observation(S, PoseEstimate(S, in_holes, np.eye(3), S)))
    tried = []
    for to_left in (first, first, first, not first, first):
        context.jammed(to_left)
        tried.append(context.aim.yaw)
    assert tried == pytest.approx([-side * yaw for yaw in (0.0, 0.04, 0.08, 0.08, 0.08)])


@given(st.floats(-0.1, 0.1), st.floats(-0.02, 0.02), st.floats(-0.1, 0.1))
def test_the_frame_that_a_unit_aims_at_is_beside_the_axis_and_turned(
    x: float, aside: float, yaw: float
) -> None:
    """A body at ``x`` ahead of it, on its axis."""
    aim = Aim()
    aim.jammed(abs(aside), aside > 0.0)
    aim.turned(abs(yaw), yaw < 0.0)
    X = (aim.X_DA @ SE2(x, 0.0, 0.0)).as_array()
    assert pytest.approx([x * math.cos(yaw), aside + x * math.sin(yaw), yaw]) == X


@pytest.mark.parametrize("to_left", [True, False])
def test_pins_that_stop_before_the_holes_are_tried_on_both_sides(to_left: bool) -> None:
    aim = Aim()
    tried = []
    for _ in range(3):
        tried.append(aim.lateral)
        aim.stopped(0.003, to_left)
    assert sorted(tried) == [-0.003, 0.0, 0.003]
    assert (tried[1] > 0.0) is to_left
    for _ in range(2):
        tried.append(aim.lateral)
        aim.stopped(0.003, to_left)
    assert sorted(tried) == [-0.006, -0.003, 0.0, 0.003, 0.006]
    assert (tried[3] > 0.0) is to_left


@given(
    st.floats(0.001, 0.01),
    st.lists(st.tuples(st.booleans(), st.booleans()), max_size=20),
    st.floats(-0.02, 0.02),
)
def test_no_place_is_tried_that_jams_have_ruled_out(
    step: float, contacts: list[tuple[bool, bool]], port: float
) -> None:
    """Pins jam or stop anywhere; the funnel turns the unit towards the port."""
    aim, right, left = Aim(), -math.inf, math.inf
    for jams, to_left in contacts:
        if jams:
            right, left = (aim.lateral, left) if port > aim.lateral else (right, aim.lateral)
            aim.jammed(step, port > aim.lateral)
        else:
            aim.stopped(step, to_left)
        assert right <= aim.lateral <= left


def test_progress_is_a_fall_below_the_best_by_more_than_a_step() -> None:
    memory = StateMemory(0)
    assert memory.without_progress(0.50, 0.01, 0.0, 1 * S) == 0.0
    assert memory.without_progress(0.495, 0.01, 0.0, 3 * S) == 2.0  # not enough
    assert memory.without_progress(0.48, 0.01, 0.0, 4 * S) == 0.0
    assert memory.without_progress(0.60, 0.01, 0.0, 6 * S) == 2.0  # back again, and again to the best
    assert memory.without_progress(0.48, 0.01, 0.0, 7 * S) == 3.0
    assert memory.lasted(7 * S) == 7.0


def test_frames_in_a_row_are_new_ones_exposed_since_the_phase_began() -> None:
    memory = StateMemory(10)
    counts = [memory.frames_in_a_row(ns, ok) for ns, ok in [(10, True), (11, True), (11, True), (12, True)]]
    assert counts == [0, 1, 1, 2]
    assert memory.frames_in_a_row(13, False) == 0
    assert memory.frames_in_a_row(14, True) == 1


@pytest.fixture
def context(facts: DockSetup) -> DockingContext:
    law = build_controller(Choice(name="c1"), facts)
    return DockingContext(DockingSpec(), facts, law, None, PhaseTuning(), 0.02)


def _seen(now_ns: int, gap: float, offset: float) -> Observation:
    return Observation(now_ns, PoseEstimate(now_ns, SE2(-gap - offset, 0.0, 0.0), np.eye(3) * 1e-6, now_ns))


def test_a_gap_that_was_never_known_is_that_of_a_finished_retreat(context: DockingContext) -> None:
    context.observe(Observation(0))
    assert context.view is None
    assert not context.ever_seen
    assert context.gap == context.spec.retreat_m


def test_creeping_is_no_progress() -> None:
    """The way of 22 mm has to be made at once, or half of what is left near the seat."""
    memory = StateMemory(0)
    assert memory.without_progress(0.70, 0.001, 0.022, 1 * S) == 0.0
    for k in range(2, 12):  # 2 mm/s: each second is more than the smallest progress
        assert memory.without_progress(0.70 - 0.002 * (k - 1), 0.001, 0.022, k * S) == k - 1
    assert memory.without_progress(0.677, 0.001, 0.022, 13 * S) == 0.0
    assert memory.without_progress(0.020, 0.001, 0.022, 14 * S) == 0.0
    assert memory.without_progress(0.011, 0.001, 0.022, 15 * S) == 1.0
    assert memory.without_progress(0.009, 0.001, 0.022, 16 * S) == 0.0


def test_the_gap_goes_on_by_odometry_while_there_is_no_estimate(context: DockingContext) -> None:
    context.observe(_seen(0, 0.3, context.setup.offset))
    assert context.gap == pytest.approx(0.3)
    assert context.ever_seen
    context.observe(Observation(S // 10, twist=Twist(-0.2, 0.0)))
    assert context.view is None
    assert context.dt == pytest.approx(0.1)
    assert context.gap == pytest.approx(0.32)


@pytest.mark.parametrize(("sigma", "aside"), [(0.0, 0.003), (0.0014, 0.003), (0.004, 0.008)])
def test_after_a_jam_the_unit_goes_aside_by_the_rim_of_a_mouth_at_least(
    context: DockingContext, sigma: float, aside: float
) -> None:
    """In the holes the funnel tells the side, both times the same here; before them nothing does."""
    context.memory.sigma_lateral = sigma
    jams = {}
    for place, gap in (("holes", 0.5 * context.setup.pin_reach), ("mouths", context.setup.pin_reach)):
        context.aim, context.last_gap = Aim(), gap
        jams[place] = []
        for _ in range(2):
            context.jammed(to_left=True)
            jams[place].append(context.aim.lateral)
    assert jams["holes"] == pytest.approx([aside, 2.0 * aside])
    assert jams["mouths"] == pytest.approx([aside, -aside])


@pytest.mark.parametrize("to_left", [True, False])
@pytest.mark.parametrize(
    ("pins_m", "aside"), [(-0.005, 0.003), (0.001, 0.003), (0.005, 0.005), (0.02, 0.008)]
)
def test_in_the_holes_a_unit_goes_aside_as_far_as_they_have_turned_it(
    context: DockingContext, to_left: bool, pins_m: float, aside: float
) -> None:
    """By the rim of a mouth at least, and by twice the standard deviation of the side at most."""
    side, setup = 1.0 if to_left else -1.0, context.setup
    yaw = side * math.asin(pins_m / setup.offset)
    X_DU = SE2(-0.5 * setup.pin_reach, 0.0, 0.0) @ SE2(0.0, 0.0, yaw) @ SE2(-setup.offset, 0.0, 0.0)
    context.observe(Observation(S, PoseEstimate(S, X_DU, np.eye(3), S)))
    context.memory.sigma_lateral = 0.004
    assert context.view is not None
    assert context.view.gap == pytest.approx(0.5 * setup.pin_reach)
    context.jammed(to_left)
    assert context.aim.lateral == pytest.approx(side * aside)


def test_the_time_without_progress_runs_by_the_share_of_its_speed_that_a_unit_is_let_drive_at() -> None:
    memory = StateMemory(0)
    for k in range(1, 101):
        memory.slowed(0.25, 0.02)
        idle = memory.without_progress(1.0, 0.001, 0.02, k * S // 50) if k > 1 else 0.0
    assert idle == pytest.approx(0.25 * 2.0, abs=0.03)
