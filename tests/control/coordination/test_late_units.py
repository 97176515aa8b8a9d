"""Missions on the kinematic rig in which units are seen or found late, or are in the way again and again."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.shape import build_pattern
from msrr_control.tracks.route_finder import RouteFinder
from msrr_control.tracks.route_params import RouteParams
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import MissionState, UnitState
from msrr_scenes.specs.mission import RadioSpec
from msrr_scenes.specs.plan import DockStep, MoveStep, PlanStep, UndockStep
from msrr_scenes.specs.spec import PoseSpec

Rig = Any
Starts = Callable[..., dict[str, SE2]]
Box = tuple[float, float, float, float]
InBox = Callable[[Box], CoordinationSetup]
TIGHT = (-1.5, 1.5, -1.1, 1.1)


@pytest.fixture
def in_box(rig: type[Rig]) -> InBox:
    """The setup of an arena of another size."""
    whole = rig(Mission(), {}).setup
    return lambda box: replace(whole, finder=RouteFinder(whole.lanes.body, RouteParams(), box))


def _move(unit: str, X: SE2, name: str) -> MoveStep:
    pose = PoseSpec(x_m=X.x, y_m=X.y, yaw_deg=math.degrees(X.yaw))
    return MoveStep(move=unit, name=name, pose=pose, after=())


def test_a_route_that_leads_through_a_unit_seen_since_ends_before_it(rig: type[Rig]) -> None:
    """Unit b waits for a when c is seen on its way; its limit grew through c, and the two touched."""
    starts = {"a": SE2(-0.2, -1.2, math.pi / 2), "b": SE2(-1.5, 0.0, 0.0), "c": SE2(0.7, 0.0, 0.0)}
    steps = [_move("a", SE2(-0.2, 1.1, math.pi / 2), "across"), _move("b", SE2(1.4, 0.0, 0.0), "along")]
    run = rig(Mission(steps=steps), starts)
    run.units["c"].hidden_s = (0.0, 6.0)
    status = run.run(120.0)
    assert status.state is MissionState.COMPLETE, status.reason


def test_a_site_has_room_for_a_unit_that_was_not_seen_yet(
    rig: type[Rig], starts: Starts, in_box: InBox
) -> None:
    """The place that was left for it lay beyond the border of the arena."""
    box = (-1.5, 1.5, -1.2, 1.2)
    run = rig(Mission(shape=build_pattern("cross", 5)), starts(0, 5, box), setup=in_box(box))
    run.units["u4"].hidden_s = (0.0, 7.0)
    status = run.run(300.0)
    assert status.state is MissionState.COMPLETE, status.reason


def test_a_shape_whose_root_fails_waits_for_units_that_are_lost(rig: type[Rig], starts: Starts) -> None:
    """All others are silent for a minute; it was given up at once, as if they would not come again."""
    probe = rig(Mission(shape=build_pattern("line", 3)), starts(1, 3))
    for _ in range(5):
        probe.step()
    root = probe.coordinator._dispatcher.assigner.wanted["p0"]
    silence = {"from_s": 1.5, "until_s": 66.0, "units": [name for name in probe.units if name != root]}
    radio = RadioSpec.model_validate({"silences": [silence]})
    run = rig(Mission(shape=build_pattern("line", 3)), starts(1, 3), radio=radio)
    run.units[root].dies_s = 1.0
    status = run.run()
    assert run.units[root].dead_s is not None
    assert status.state is MissionState.INCOMPLETE, "two units are left"
    assert len(run.joints) == 1


def test_a_shape_stays_where_another_unit_has_become_its_root(
    rig: type[Rig], starts: Starts, in_box: InBox
) -> None:
    """The one that was to be the root is lost on its way, and fails when another one stands in its place."""
    mission = Mission(shape=build_pattern("line", 4), one_by_one=True)
    run = rig(mission, starts(12, 5, TIGHT), setup=in_box(TIGHT))
    coordinator = run.coordinator
    for _ in range(3):
        run.step()
    wanted = coordinator._dispatcher.assigner.wanted["p0"]
    run.units[wanted].hidden_s = (1e-9 * run.now_ns + 1.5, 1000.0)

    def is_root_in_place() -> bool:
        return any(u.task == "p0" and u.state is UnitState.DOCKED for u in run.status.units)

    while not is_root_in_place():
        run.step()
        assert run.now_ns < 100e9
    assert coordinator._units[wanted].state is UnitState.LOST
    moves, run.units[wanted].dead_s = coordinator._siting.moves, 0.0
    while coordinator._units[wanted].state is UnitState.LOST:
        run.step()
    run.step()
    assert coordinator._units[wanted].state is UnitState.FAILED
    assert coordinator._siting.moves == moves
    assert run.run().state is MissionState.COMPLETE


@pytest.mark.parametrize("from_s", [2.5, 3.5, 4.5])
def test_a_unit_that_is_heard_again_when_it_counts_as_lost_stands(from_s: float, rig: type[Rig]) -> None:
    """An authority that was under way for two seconds led it on, to where another one was let by then."""
    starts = {"a": SE2(-1.6, 0.0, 0.0), "b": SE2(0.0, -1.2, math.pi / 2)}
    steps = [_move("a", SE2(1.5, 0.0, 0.0), "along"), _move("b", SE2(0.0, 1.1, math.pi / 2), "across")]
    silence = {"from_s": from_s, "until_s": from_s + 60.6, "units": ["a"]}
    radio = RadioSpec.model_validate({"latency_ms": 2000, "silences": [silence]})
    run = rig(Mission(steps=steps), starts, radio=radio)
    a, speed = run.coordinator._units["a"], 0.0
    while run.now_ns < 200e9 and run.status.state is MissionState.RUNNING:
        run.step()
        if a.state is UnitState.LOST:
            speed = max(speed, run.units["a"].speed)
    assert run.status.state is MissionState.COMPLETE, run.status.reason
    assert speed == 0.0


def test_a_unit_makes_way_as_often_as_a_long_plan_needs(rig: type[Rig]) -> None:
    """Each time unit b has to leave the border before a docks; the fourth time it stayed."""
    plan: list[PlanStep] = []
    for k in range(4):
        plan += [
            MoveStep(move="b", name=f"away{k}", pose=PoseSpec(x_m=-1.55)),
            DockStep(unit="a", to="b.rear", name=f"dock{k}"),
            UndockStep(undock="a", name=f"undock{k}"),
        ]
    run = rig(Mission(steps=plan), {"a": SE2(1.2, 0.5, 2.0), "b": SE2()})
    status = run.run(900.0)
    assert status.state is MissionState.COMPLETE, status.reason


@pytest.mark.parametrize("errs", ["held", "slips"])
def test_what_goes_wrong_once_on_the_way_of_each_step_does_not_end_a_long_plan(
    errs: str, rig: type[Rig]
) -> None:
    """The third route that was held, and the thirteenth that ended elsewhere, failed in the last step."""
    count = {"held": 3, "slips": 14}[errs]
    steps = [_move("a", SE2([1.2, -1.2][k % 2], [0.6, -0.6][k % 2], 0.0), f"m{k}") for k in range(count)]
    run, begun, first = rig(Mission(steps=steps), {"a": SE2(-1.2, -0.6, 0.0)}), 0, 0
    a, known = run.units["a"], run.coordinator._units["a"]
    while run.now_ns < 900e9 and run.status.state is MissionState.RUNNING:
        run.step()
        if known.task == f"m{begun}" and known.under_way:
            begun, first = begun + 1, known.route
            a.held_routes, a.slips_m = (known.route, 0.0) if errs == "held" else (0, 0.1)
        elif a.route > first:
            a.held_routes, a.slips_m = 0, 0.0
    assert run.status.state is MissionState.COMPLETE, run.status.reason
    assert run.status.replans >= count


def test_a_unit_that_misses_the_place_of_the_root_each_time_is_replaced(
    rig: type[Rig], starts: Starts
) -> None:
    """It was sent there until the mission ended, while two others stood free."""
    run = rig(Mission(shape=build_pattern("line", 3)), starts(0, 5))
    wanted = None
    while run.now_ns < 400e9 and run.status.state is MissionState.RUNNING:
        run.step()
        if wanted is None and (wanted := run.coordinator._dispatcher.assigner.wanted.get("p0")):
            run.units[wanted].slips_m = 0.05
    assert run.status.state is MissionState.COMPLETE, run.status.reason
    assert next(u.unit for u in run.status.units if u.task == "p0" and u.state is UnitState.DOCKED) != wanted


@pytest.mark.parametrize("last", [False, True])
def test_the_way_of_a_unit_that_is_lost_in_its_dock_leg_is_kept_for_it(last: bool, rig: type[Rig]) -> None:
    """It comes again unheard, 40 s after it was lost; another one had been let before the port by then.

    That one goes about until the first is lost, and drives in between only if ``last`` says so.
    """
    X_WB = SE2(0.8, 0.0, 0.0)
    steps: list[PlanStep] = [DockStep(unit="a", to="b.rear", name="dock", after=())]
    label: tuple[str, ...] = ()
    for k in range(10 if last else 12):
        pose = PoseSpec(x_m=-1.5, y_m=[-1.2, 1.2][k % 2])
        steps.append(MoveStep(move="c", name=f"m{k}", after=label, pose=pose))
        label = (f"m{k}",)
    if last:
        before = rig(Mission(), {}).setup.lanes.body.docked(X_WB, "rear") @ SE2(-0.15, 0.0, 0.0)
        pose = PoseSpec(x_m=before.x, y_m=before.y, yaw_deg=90.0)
        steps.append(MoveStep(move="c", name="last", after=label, pose=pose))
    radio = RadioSpec.model_validate({"silences": [{"from_s": 12.0, "until_s": 1000.0, "units": ["a"]}]})
    starts = {"a": SE2(-0.6, 0.0, 0.0), "b": X_WB, "c": SE2(-1.5, 1.2, 0.0)}
    run = rig(Mission(steps=steps), starts, radio=radio)
    run.units["a"].misses, run.units["a"].looks_s = 1, 190.0
    lost = False
    while run.now_ns < 230e9:
        run.step()
        lost |= run.coordinator._units["a"].state is UnitState.LOST
    assert lost
    assert run.units["a"].holder == "b.rear", "it has docked, and touched nobody"


def test_two_searches_that_are_long_together_are_no_failure(rig: type[Rig], starts: Starts) -> None:
    """The unit counted as failed after 150 s, went on, and met the one that had been given its port."""
    run = rig(Mission(shape=build_pattern("line", 2)), starts(0, 3))
    while (docks := next((u.unit for u in run.status.units if u.task == "p1"), None)) is None:
        run.step()
    run.units[docks].misses, run.units[docks].looks_s = 2, 80.0
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert docks in run.joints
