"""Missions on the kinematic rig: all are completed, nobody touches anybody, whatever the radio does.

The rig itself asserts at every step that no two bodies touch, that nobody is on ground that was not granted,
that no authority shrinks within a route and that no route changes under a unit that moves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import pytest

from msrr_control.coordination.ledger import SAME_M, UnitRecord
from msrr_control.coordination.mission import Mission, Patience
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.watch import Watch
from msrr_control.shapes.reconfiguration import shape_ports
from msrr_control.shapes.shape import Shape, build_pattern
from msrr_control.shapes.tasks import plan_tasks
from msrr_control.tracks.route_finder import RouteFinder
from msrr_control.tracks.route_params import RouteParams
from msrr_control.tracks.track import TrackBuilder
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import (
    LegKind,
    MissionState,
    UnitMode,
    UnitReport,
    UnitState,
)
from msrr_scenes.specs.control import DockingSpec
from msrr_scenes.specs.mission import Pattern, RadioSpec
from msrr_scenes.specs.plan import DockStep, MoveStep, UndockStep
from msrr_scenes.specs.spec import PoseSpec

Rig = Any
Starts = Callable[..., dict[str, SE2]]

PORTS = ("rear", "left", "right")

BAD_RADIO = RadioSpec.model_validate(
    {"loss": 0.2, "latency_ms": 200, "jitter_ms": 100, "silences": [{"from_s": 8, "until_s": 18}]}
)


#: Seed, errors of sight [m, rad] and time until they have settled [s] with which a pattern is built.
ERRING = {
    "tee": (4, (0.012, 0.02), 1.0),
    "cross": (7, (0.012, 0.02), 1.0),
    "comb": (9, (0.012, 0.02), 1.0),
    "zigzag": (1, (0.003, 0.01), math.inf),
}


@pytest.fixture(scope="module")
def cross(rig: type[Rig], starts: Starts) -> Rig:
    """Five units that have become a cross, over a good radio."""
    run = rig(Mission(shape=build_pattern("cross", 5)), starts(3, 5))
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    return run


@pytest.mark.parametrize("pattern", sorted(set(get_args(Pattern)) - ERRING.keys()))
def test_a_shape_is_built_in_parallel(pattern: Pattern, rig: type[Rig], starts: Starts) -> None:
    shape = build_pattern(pattern, 5)
    run = rig(Mission(shape=shape), starts(11, 5))
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    assert run.moving_s[1] > 0.25 * run.moving_s[0], "units did not move at the same time"


def test_together_is_faster_than_one_by_one(cross: Rig, rig: type[Rig], starts: Starts) -> None:
    alone = rig(Mission(shape=build_pattern("cross", 5), one_by_one=True), starts(3, 5))
    assert alone.run().state is MissionState.COMPLETE
    assert alone.moving_s[1] == 0.0
    assert cross.last_lock_s < 0.6 * alone.last_lock_s


def test_the_same_mission_gives_the_same_messages(rig: type[Rig], starts: Starts) -> None:
    runs = [
        rig(Mission(shape=build_pattern("tee", 4)), starts(5, 4), radio=BAD_RADIO, seed=2) for _ in range(2)
    ]
    for run in runs:
        run.run(15.0)
    assert len(runs[0].authorities) > 50
    assert runs[0].authorities == runs[1].authorities


def test_a_bad_radio_costs_time_and_nothing_else(cross: Rig, rig: type[Rig], starts: Starts) -> None:
    shape = build_pattern("cross", 5)
    run = rig(Mission(shape=shape), starts(3, 5), radio=BAD_RADIO, seed=1)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    assert cross.last_lock_s < run.last_lock_s < cross.last_lock_s + 25.0


def test_a_unit_that_fails_is_replaced_by_a_spare(rig: type[Rig], starts: Starts) -> None:
    shape = build_pattern("cross", 5)
    run = rig(Mission(shape=shape), starts(1, 6), dies={"u3": (5.0, False)})
    status = run.run()
    assert run.units["u3"].dead_s is not None
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    assert "u3" not in run.joints


def test_a_mission_names_every_unit_that_failed_for_the_same_reason(rig: type[Rig]) -> None:
    """A unit was left out whose reason another one has, too: here one that made way, which is no task."""
    there = MoveStep(move="a", name="there", pose=PoseSpec(x_m=1.0, y_m=0.0))
    run = rig(Mission(steps=[there]), {"a": SE2(-1.2, 0.0, 0.0), "b": SE2(1.0, 0.0, 0.0)})
    a, b = run.units["a"], run.units["b"]
    while run.status.state is MissionState.RUNNING and run.now_ns < 200e9:
        run.step()
        if math.hypot(b.X_WU.x - 1.0, b.X_WU.y) > 0.12:
            b.dies_s = 0.0
        if a.speed > 0.05:
            a.dies_s = 0.0
    assert run.status.state is MissionState.INCOMPLETE
    assert run.status.reason == "there: a failed: seized; b: seized"


def test_a_unit_that_its_collision_monitor_holds_gets_another_route(rig: type[Rig], starts: Starts) -> None:
    """Without a spare, over a bad radio: until it has another one, it may drive on on the one it has."""
    shape = build_pattern("cross", 5)
    for radio in (RadioSpec(), BAD_RADIO):
        run = rig(Mission(shape=shape), starts(1, 5), radio=radio)
        run.units["u2"].held_routes = 1
        status = run.run()
        assert status.state is MissionState.COMPLETE, status.reason
        assert run.is_built(shape)
        assert run.units["u2"].route > 1
        assert status.replans > 0


def test_a_unit_moves_into_a_corner_and_out_of_it(rig: type[Rig], setup: CoordinationSetup) -> None:
    corner = SE2(1.87, -1.38, math.radians(30.0))
    there = MoveStep(move="a", name="there", pose=PoseSpec(x_m=corner.x, y_m=corner.y, yaw_deg=30.0))
    run = rig(Mission(steps=[there]), {"a": SE2(0.0, 0.0, 0.0)})
    assert run.run().state is MissionState.COMPLETE, run.status.reason
    assert setup.tolerance.holds(corner.inverse() @ run.units["a"].X_WU)
    back = rig(Mission(steps=[MoveStep(move="a")]), {"a": corner})
    assert back.run().state is MissionState.COMPLETE, back.status.reason


def test_only_the_route_of_a_unit_that_was_held_avoids_a_turn_where_it_stands(
    rig: type[Rig], setup: CoordinationSetup, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, find = [], setup.finder.find
    monkeypatch.setattr(setup.finder, "find", lambda request: (asked.append(request.held), find(request))[1])
    steps = [
        MoveStep(move="a", name=name, pose=PoseSpec(x_m=x)) for name, x in (("out", 1.2), ("back", -1.0))
    ]
    run = rig(Mission(steps=steps), {"a": SE2(-1.0, 0.0, 0.0)})
    run.units["a"].held_routes = 1
    assert run.run().state is MissionState.COMPLETE
    assert asked == [False, True, False]


@pytest.mark.parametrize(
    ("pattern", "looks_s"),
    [
        ("line", 0.0),
        ("comb", DockingSpec().search_time_s),
        pytest.param("line", DockingSpec().search_time_s, marks=pytest.mark.nightly),
        pytest.param("comb", 0.0, marks=pytest.mark.nightly),
    ],
)
def test_nobody_is_sent_away_while_a_unit_tries_again_to_dock(
    pattern: Pattern, looks_s: float, rig: type[Rig], starts: Starts
) -> None:
    """Neither while it backs off and comes again, nor while it stands and looks for the port before that."""
    shape = build_pattern(pattern, 4)
    run = rig(Mission(shape=shape), starts(4, 4))
    for unit in run.units.values():
        unit.misses, unit.looks_s = 2, looks_s
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    assert sum(unit.misses for unit in run.units.values()) == 2, "the root docks to nobody"
    assert status.replans == 0


@pytest.mark.parametrize("pattern", ERRING)
def test_sight_that_errs_keeps_no_unit_from_docking_beside_another(
    pattern: Pattern, rig: type[Rig], starts: Starts
) -> None:
    """Neighbours in a shape have 28 mm between them and need 20; the docks say so, whatever sight says."""
    shape, (seed, noise, noisy_s) = build_pattern(pattern, 6), ERRING[pattern]
    run = rig(Mission(shape=shape), starts(seed, 6), seed=seed, noise=noise, noisy_s=noisy_s)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    assert status.replans == 0
    assert run.moving_s[1] > 0.25 * run.moving_s[0], "units did not move at the same time"


def test_a_unit_that_never_comes_again_to_its_port_is_replaced(rig: type[Rig], starts: Starts) -> None:
    """It has been at the end of its route, stands for ever in its dock leg, and reports no failure."""
    shape = build_pattern("line", 3)
    run = rig(Mission(shape=shape), starts(4, 4))
    while not (docking := [unit for unit in run.units.values() if unit.mode is UnitMode.DOCKING]):
        run.step()
    docking[0].misses, docking[0].looks_s = 1, 1e6
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    (failed,) = [unit for unit in status.units if unit.state is UnitState.FAILED]
    assert failed.unit == docking[0].name
    assert "in 150 s" in failed.reason


def test_a_unit_that_is_held_on_every_route_fails_in_the_end(rig: type[Rig], starts: Starts) -> None:
    run = rig(Mission(shape=build_pattern("cross", 5)), starts(1, 5))
    run.units["u2"].held_routes = 99
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "u2: no progress beyond" in status.reason
    assert len({a.route for a in run.authorities if a.unit == "u2" and a.legs}) == 3
    assert len(status.done) == 4


def test_a_unit_that_goes_on_by_itself_keeps_its_route(rig: type[Rig], starts: Starts) -> None:
    """As where what its monitor stopped for has gone meanwhile, after the base station has begun a recall."""
    run = rig(Mission(shape=build_pattern("cross", 5)), starts(1, 5))
    run.units["u2"].held_routes = 99
    while run.now_ns < 100e9 and not run.coordinator._recall.is_recalled(run.coordinator._units["u2"]):
        run.step()
    run.units["u2"].held_routes = 0
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.units["u2"].route == 1


def test_without_a_spare_all_else_is_built_and_the_unit_is_named(rig: type[Rig], starts: Starts) -> None:
    shape = build_pattern("cross", 5)
    run = rig(Mission(shape=shape), starts(1, 5), dies={"u2": (4.0, False)})
    status = run.run()
    assert run.units["u2"].dead_s is not None
    assert status.state is MissionState.INCOMPLETE
    assert "u2" in status.reason
    assert "seized" in status.reason
    assert len(status.done) == 4
    assert len(run.joints) == 3


def test_a_place_that_is_left_empty_for_a_unit_that_nobody_saw_says_so(
    rig: type[Rig], starts: Starts
) -> None:
    """It said that no unit was left, of one that stood there with its tags covered."""
    run = rig(Mission(shape=build_pattern("line", 3)), starts(1, 3))
    run.units["u1"].hidden_s = (0.0, 1000.0)
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert status.reason == "p2: no unit is left; never seen from above: u1"


@pytest.mark.parametrize(
    ("spare", "hidden_s"), [(False, (5.0, 20.0)), (True, (5.0, 20.0)), (False, (5.0, 90.0))]
)
def test_a_unit_that_was_lost_is_taken_up_again(
    spare: bool, hidden_s: tuple[float, float], rig: type[Rig], starts: Starts
) -> None:
    """One hidden for 15 s comes back to its place, unless a spare has it; one hidden for ever does not."""
    shape = build_pattern("cross", 5)
    run, name = rig(Mission(shape=shape), starts(1, 5 + spare)), "u3" if spare else "u2"
    run.units[name].hidden_s = hidden_s
    states: list[UnitState] = []
    while run.now_ns < 400e9 and run.status.state is MissionState.RUNNING:
        run.step()
        state = next(unit.state for unit in run.status.units if unit.unit == name)
        if not states or states[-1] is not state:
            states.append(state)
    status, way = run.status, [UnitState.IDLE, UnitState.UNDER_WAY, UnitState.LOST]
    if hidden_s[1] > 50.0:
        assert status.state is MissionState.INCOMPLETE
        assert name in status.reason
        assert len(status.done) == 4
        assert states == way
        return
    assert states == way + ([UnitState.IDLE] if spare else [UnitState.UNDER_WAY, UnitState.DOCKED])
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    assert (name in run.joints) is not spare


@pytest.mark.parametrize(("from_s", "docks"), [(3.0, False), (12.8, True)])
def test_a_unit_that_was_silent_for_long_is_taken_up_again(
    from_s: float, docks: bool, rig: type[Rig], starts: Starts
) -> None:
    """One on its way has braked and gets another route; one that docks goes on, and needs no other."""
    shape, lost = build_pattern("line", 3), False
    spec = {"silences": [{"from_s": from_s, "until_s": 80.0, "units": ["u2"]}]}
    run = rig(Mission(shape=shape), starts(30, 3), radio=RadioSpec.model_validate(spec))
    while run.now_ns < 400e9 and run.status.state is MissionState.RUNNING:
        run.step()
        lost |= any(unit.state is UnitState.LOST for unit in run.status.units)
        if run.now_ns == 79_000_000_000:
            assert ("u2" in run.joints) is docks
    assert run.status.state is MissionState.COMPLETE, run.status.reason
    assert run.is_built(shape)
    assert lost is not docks


def test_a_unit_that_hears_nothing_until_it_is_lost_stands_by_then(rig: type[Rig], starts: Starts) -> None:
    """The last authority before it was lost would have arrived a second late, and led it on once more."""
    shape = build_pattern("line", 3)
    silence = {"from_s": 3.0, "until_s": 63.5, "units": ["u2"]}
    radio = RadioSpec.model_validate({"silences": [silence], "latency_ms": 1000})
    run, lost, lost_routes = rig(Mission(shape=shape), starts(30, 3), radio=radio), 0, set()
    while run.now_ns < 400e9 and run.status.state is MissionState.RUNNING:
        run.step()
        (unit,) = [unit for unit in run.status.units if unit.unit == "u2"]
        if unit.state is UnitState.LOST:
            lost += run.units["u2"].mode is UnitMode.DRIVING
            lost_routes.add(unit.route)
    assert lost_routes
    assert lost == 0, "it has driven while it counted as lost"
    assert run.status.state is MissionState.COMPLETE, run.status.reason
    assert run.is_built(shape)
    assert len(lost_routes) == 1


def test_a_unit_that_is_found_in_the_port_that_it_was_to_leave_stays_there(rig: type[Rig]) -> None:
    """It never heard of its route, and meanwhile a unit that does not move was put behind it."""
    body = rig(Mission(), {}).setup.lanes.body
    X_WA = SE2(0.5, 0.0, 0.0)
    place = body.docked(X_WA, "rear")
    starts = {"a": X_WA, "b": place, "dead": SE2(-1.5, 1.0, 0.0)}
    radio = RadioSpec.model_validate({"silences": [{"from_s": 0.0, "until_s": 70.0, "units": ["b"]}]})
    run = rig(Mission(steps=[UndockStep(undock="b")], holders={"b": "a.rear"}), starts, radio=radio)
    run.units["dead"].dead_s = -10.0
    b = run.coordinator._units["b"]
    _run_until(run, lambda: b.state is UnitState.LOST)
    run.units["dead"].X_WU = place @ SE2(-0.3, 0.0, 0.0)
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "dead" in status.reason
    assert run.joints == {"b": "a.rear"}


def test_a_unit_whose_authority_ends_just_before_its_route_does_has_not_arrived(rig: type[Rig]) -> None:
    """It drives the last millimetres when it is heard again; by then it had got its next route."""
    steps = [
        MoveStep(move="a", name="first", pose=PoseSpec(x_m=0.5)),
        MoveStep(move="a", pose=PoseSpec(x_m=-0.5, y_m=0.5)),
    ]

    def mission(from_s: float) -> Rig:
        spec = {"silences": [{"from_s": from_s, "until_s": 20.0, "units": ["a"]}]}
        return rig(Mission(steps=steps), {"a": SE2()}, radio=RadioSpec.model_validate(spec))

    whole, short = mission(19.0), 0
    _run_until(whole, lambda: whole.units["a"].X_WU.x > 0.49)
    for later_s in (0.0, 0.1, 0.2, 0.3):
        run = mission(round(1e-9 * whole.now_ns - Patience().expires_s + later_s, 2))
        while run.now_ns < 19e9:
            run.step()
        unit = run.units["a"]
        short += unit.route == 1 and 0.001 < unit.track.length - unit.progress < SAME_M
        status = run.run()
        assert status.state is MissionState.COMPLETE, status.reason
    assert short > 0


def test_a_unit_that_hears_nothing_just_before_the_end_of_its_route_fails(rig: type[Rig]) -> None:
    """It stands where it was allowed to go and waits for nobody, but its authority has ended before that."""
    mission = Mission(steps=[MoveStep(move="a", pose=PoseSpec(x_m=0.5))])
    whole, short = rig(mission, {"a": SE2()}), 0
    _run_until(whole, lambda: whole.units["a"].X_WU.x > 0.49)
    for later_s in (0.0, 0.1, 0.2, 0.3):
        run = rig(mission, {"a": SE2()})
        unit = run.units["a"]
        unit.deaf_s = 1e-9 * whole.now_ns - Patience().expires_s + later_s
        status = run.run(2.0 * Patience().lost_s)
        left = unit.track.length - unit.progress
        short += 0.001 < left < SAME_M
        if left > 0.001 or status.state is not MissionState.COMPLETE:
            assert status.state is MissionState.INCOMPLETE
            assert "a failed: no progress beyond" in status.reason
    assert short > 0


def test_a_step_of_a_unit_that_has_failed_before_says_so(rig: type[Rig]) -> None:
    """It was told to find no route, of a unit that had seized up before its step began."""
    starts = {"a": SE2(-1.4, 0.0, 0.0), "b": SE2(0.9, 0.6, 0.0), "c": SE2(-0.3, 0.6, 0.0)}
    steps = [DockStep(unit="c", to="b.rear"), MoveStep(move="a", pose=PoseSpec(x_m=-0.5, y_m=-0.6))]
    run = rig(Mission(steps=steps), starts)
    run.units["a"].dead_s = -10.0
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert status.done == ("c",)
    assert "a has failed: seized" in status.reason


def test_what_was_given_up_for_a_lost_unit_is_done_when_it_is_found(rig: type[Rig]) -> None:
    """The first of two places was given up when their units are heard again."""
    shape = build_pattern("cross", 4)
    starts = {"u0": SE2(-0.12, 0.39, -2.23), "u1": SE2(-1.13, -0.82, 0.91), "u2": SE2(-0.41, 1.16, -2.94)}
    silences = [{"from_s": 1.8, "until_s": 98.0, "units": ["u1", "u2"]}]
    radio = RadioSpec.model_validate({"silences": silences})
    run = rig(Mission(shape=shape), {**starts, "u3": SE2(1.25, 0.08, 0.26)}, radio=radio)
    while run.now_ns < 97.5e9:
        run.step()
    assert run.status.given_up == ("p1",)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert status.given_up == ()
    assert run.is_built(shape)


def test_every_task_of_a_mission_that_has_ended_is_done_or_given_up(rig: type[Rig], starts: Starts) -> None:
    """Also where nobody is left for whom the shape could be built elsewhere."""
    radio = RadioSpec.model_validate({"silences": [{"from_s": 1.0, "until_s": 200.0}]})
    run = rig(Mission(shape=build_pattern("line", 3)), starts(1, 3), radio=radio)
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "no unit is there for the root of the shape" in status.reason
    assert sorted(status.done + status.given_up) == ["p0", "p1", "p2"]


def test_nobody_makes_way_where_a_lost_unit_stands_in_the_lane(rig: type[Rig], starts: Starts) -> None:
    """It helped nobody."""
    spec = {"silences": [{"from_s": 6.8, "until_s": 82.0, "units": ["u2"]}]}
    run = rig(Mission(shape=build_pattern("line", 3)), starts(27, 3), radio=RadioSpec.model_validate(spec))
    lost = False
    while run.status.state is MissionState.RUNNING:
        run.step()
        lost |= any(unit.state is UnitState.LOST for unit in run.status.units)
        assert not any(unit.reason == "makes way" for unit in run.status.units)
    assert lost
    assert run.status.state is MissionState.COMPLETE, run.status.reason


def test_who_cannot_take_the_first_open_place_takes_another_one(rig: type[Rig], starts: Starts) -> None:
    """It made way three times, for a place whose lane was closed for good, before it took another one."""
    shape = build_pattern("cross", 6)
    run = rig(Mission(shape=shape), starts(1, 6), dies={"u3": (3.0, False), "u4": (2.0, True)})
    while run.status.state is MissionState.RUNNING:
        run.step()
        assert not any(unit.reason == "makes way" for unit in run.status.units)
    assert run.status.done == ("p0", "p3", "p4", "p5")
    assert run.joints["u0"] == "u5.right"


def test_who_cannot_take_a_place_in_which_a_silent_unit_may_be_takes_another_one(
    rig: type[Rig], starts: Starts
) -> None:
    """It made way, and then found no route past the silent one, which did not count as docked for that."""
    spec = {"silences": [{"from_s": 12.5, "until_s": 1000.0, "units": ["u4"]}]}
    radio = RadioSpec.model_validate(spec)
    run = rig(Mission(shape=build_pattern("cross", 6)), starts(1, 6), radio=radio, dies={"u3": (3.0, False)})
    while run.status.state is MissionState.RUNNING:
        run.step()
        assert not any(unit.reason == "makes way" for unit in run.status.units)
    assert run.joints["u4"] == "u5.rear"
    assert run.joints["u0"] == "u5.right"
    assert run.status.done == ("p0", "p3", "p4", "p5")


def test_what_a_silent_unit_may_have_docked_to_stays_where_it_is(rig: type[Rig], starts: Starts) -> None:
    """Nobody hears that it has docked: the shape is not built elsewhere, and who waits is told why."""
    spec = {"silences": [{"from_s": 12.8, "until_s": 1000.0, "units": ["u2"]}]}
    run = rig(Mission(shape=build_pattern("line", 3)), starts(30, 3), radio=RadioSpec.model_validate(spec))
    while "u2" not in run.joints:
        run.step()
    root = run.units["u0"].X_WU
    status = run.run()
    assert (run.joints, run.units["u0"].X_WU) == ({"u2": "u0.rear"}, root)
    assert status.state is MissionState.INCOMPLETE
    assert "u1 cannot dock: u0.rear is taken by u2" in status.reason
    assert "u2: not heard for 150 s" in status.reason


@pytest.mark.parametrize("until_s", [80.0, 1000.0])
def test_the_port_of_a_silent_unit_that_has_stopped_in_the_open_is_free(
    until_s: float, rig: type[Rig], starts: Starts
) -> None:
    """It was allowed into the port, is seen far before it, and gets another place when it is heard again."""
    spec = {"silences": [{"from_s": 6.0, "until_s": until_s, "units": ["u2"]}]}
    run = rig(Mission(shape=build_pattern("line", 3)), starts(30, 3), radio=RadioSpec.model_validate(spec))
    status = run.run()
    if until_s < 100.0:
        assert status.state is MissionState.COMPLETE, status.reason
        assert run.joints == {"u1": "u0.rear", "u2": "u1.rear"}
        return
    assert run.joints == {"u1": "u0.rear"}
    assert status.state is MissionState.INCOMPLETE
    assert status.reason.startswith("p2: no unit is left; out of action: u2")


def test_a_step_waits_for_the_unit_that_it_names(rig: type[Rig]) -> None:
    """Also where nobody docks to a unit that is lost, nor is let onto the ground where it stands."""
    starts = {"a": SE2(-1.4, 0.0, 0.0), "b": SE2(-0.2, 0.6, 0.0)}
    steps = [
        MoveStep(move="b", name="away", pose=PoseSpec(x_m=0.9), after=()),
        DockStep(unit="a", to="b.rear", after=()),
    ]
    for until_s, complete in ((17.0, True), (200.0, False)):
        run = rig(Mission(steps=steps), starts)
        run.units["b"].hidden_s = (2.0, until_s)
        status = run.run()
        assert (status.state is MissionState.COMPLETE) is complete, status.reason
        assert complete or "b is lost: " in status.reason


@pytest.mark.parametrize("unseen", ["a", "b"])
@pytest.mark.parametrize("until_s", [25.0, math.inf])
def test_a_unit_that_was_not_seen_yet_is_waited_for(rig: type[Rig], unseen: str, until_s: float) -> None:
    """As one that is lost, and the reason says who was not seen; it gave up after 10 s."""
    starts = {"a": SE2(-1.0, 0.0, 0.0), "b": SE2(0.8, 0.3, 0.4)}
    run = rig(Mission(steps=[DockStep(unit="a", to="b.rear")]), starts)
    run.units[unseen].hidden_s = (0.0, until_s)
    status = run.run(120.0)
    if until_s < math.inf:
        assert status.state is MissionState.COMPLETE
    else:
        assert status.state is MissionState.INCOMPLETE
        assert f"{unseen} was never seen from above" in status.reason
        assert 30.0 < run.now_ns * 1e-9 < 45.0


@pytest.mark.parametrize(("assembled", "until_s"), [(True, 12.0), (True, math.inf), (False, math.inf)])
def test_a_shape_waits_for_the_first_sight_of_its_root(
    rig: type[Rig], assembled: bool, until_s: float
) -> None:
    """It was given up after 5 s, for an overhead camera that began to see later."""
    root = SE2(0.4, -0.4, 0.3)
    docked = rig(Mission(), {}).setup.lanes.body.docked(root, "rear")
    starts = {"a": root, "b": docked if assembled else SE2(-1.0, -0.6)}
    shape = Shape.from_tree({"a": "root", "b": "a.left"})
    mission = Mission(shape=shape, named=True, holders={"b": "a.rear"} if assembled else {})
    run = rig(mission, starts)
    run.units["a"].hidden_s = (0.0, until_s)
    status = run.run(120.0)
    if until_s < math.inf:
        assert (status.state, run.joints) == (MissionState.COMPLETE, {"b": "a.left"}), status.reason
    else:
        assert status.state is MissionState.INCOMPLETE
        assert "not seen: a" in status.reason
        assert 30.0 < run.now_ns * 1e-9 < 31.0


def test_a_unit_that_is_first_seen_when_its_task_was_given_up_for_want_of_it_does_it(rig: type[Rig]) -> None:
    """Of two that were never seen one did its task, which was still open, and the other stayed idle."""
    starts = {"a": SE2(-1.2, 0.6), "b": SE2(0.6, 0.6), "c": SE2(-1.2, -0.6), "d": SE2(0.6, -0.6)}
    steps = [DockStep(unit="a", to="b.rear", after=()), DockStep(unit="c", to="d.rear", after=())]
    run = rig(Mission(steps=steps), starts)
    run.units["a"].hidden_s = run.units["c"].hidden_s = (0.0, math.inf)
    while run.now_ns < 100e9 and not run.status.given_up:
        run.step()
    assert (len(run.status.given_up), run.status.state) == (1, MissionState.RUNNING)
    assert run.units["b"].route == 0, "nobody makes way for a unit that may be anywhere"
    run.units["a"].hidden_s = run.units["c"].hidden_s = (0.0, 0.0)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == {"a": "b.rear", "c": "d.rear"}


def test_what_was_given_up_stays_so_once_the_mission_has_ended(rig: type[Rig], starts: Starts) -> None:
    run = rig(Mission(shape=build_pattern("line", 3)), starts(1, 3))
    run.units["u1"].hidden_s = (0.0, 1000.0)
    ended = run.run()
    run.units["u1"].hidden_s = (0.0, 0.0)
    for _ in range(20):
        run.step()
    assert (run.status.state, run.status.given_up) == (MissionState.INCOMPLETE, ended.given_up)


def test_an_assembly_takes_another_shape(rig: type[Rig]) -> None:
    line, tee = build_pattern("line", 5), build_pattern("tee", 5)
    names = {place.name: f"u{k}" for k, place in enumerate(line.places)}
    holders = {names[p.name]: f"{names[p.parent]}.{p.port}" for p in line.places if p.parent is not None}
    body = rig(Mission(), {}).setup.lanes.body
    poses = line.poses(SE2(0.9, -0.2, 0.1), body)
    run = rig(Mission(shape=tee, holders=holders), {names[k]: X for k, X in poses.items()})
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(tee)
    stayed = [name for name, unit in run.units.items() if unit.route == 0]
    assert len(stayed) == len(line.places) - len(status.done)


def test_shapes_are_built_one_after_the_other_from_what_the_units_report(
    rig: type[Rig], starts: Starts
) -> None:
    """From anywhere to a line, then by leaves to a tee and back; the status names the shape."""
    line, tee = build_pattern("line", 4), build_pattern("tee", 4)
    back = Mission(line, name="line again")
    run = rig(Mission(line, name="line", then=Mission(tee, name="tee", then=back)), starts(4, 4))
    shapes: dict[str, Shape] = {"line": line, "tee": tee, "line again": line}
    seen: list[str] = []
    while run.now_ns < 400e9 and run.status.state is MissionState.RUNNING:
        if run.status.shape not in seen:
            assert not seen or run.is_built(shapes[seen[-1]]), (
                "the next begins when the one before is complete"
            )
            seen.append(run.status.shape)
        run.step()
    status = run.status
    assert status.state is MissionState.COMPLETE, status.reason
    assert seen == list(shapes)
    assert run.is_built(line)
    assert len(status.done) == 4 + 2 * (len(set(shape_ports(tee).values()) - set(shape_ports(line).values())))


def test_a_unit_that_was_held_often_in_one_shape_gets_another_route_in_the_next(
    rig: type[Rig], starts: Starts
) -> None:
    """It failed there when it was held once."""
    line, tee = build_pattern("line", 4), build_pattern("tee", 4)
    run = rig(Mission(line, name="line", then=Mission(tee, name="tee")), starts(1, 4))
    while run.now_ns < 400e9 and run.status.shape == "line":
        for name, unit in run.units.items():
            recalled = run.coordinator._units[name].recalls
            unit.held_routes = 99 if recalled < Patience().recalls else 0
        run.step()
    for unit in run.units.values():
        unit.held_routes = unit.route + 1
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(tee)


def test_a_shape_is_built_where_there_is_room_for_those_after_it(rig: type[Rig]) -> None:
    line, comb = build_pattern("line", 4), build_pattern("comb", 4)
    starts = {
        "u0": SE2(1.15, -0.07, -1.97),
        "u1": SE2(-0.20, -1.0, 2.45),
        "u2": SE2(0.51, 0.27, -0.29),
        "u3": SE2(0.91, 0.42, 2.08),
    }
    run = rig(Mission(line, name="line", then=Mission(comb, name="comb")), starts)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(comb)


def test_an_assembly_without_room_for_the_shape_says_so(rig: type[Rig]) -> None:
    body = rig(Mission(), {}).setup.lanes.body
    X_WA = SE2(0.9, 0.9, 0.0)
    starts = {"a": X_WA, "b": body.docked(X_WA, "rear")}
    tree = Shape.from_tree({"a": "root", "b": "a.left"})
    status = rig(Mission(shape=tree, holders={"b": "a.rear"}), starts).run()
    assert status.state is MissionState.INCOMPLETE
    assert "do not fit into the arena from where the root" in status.reason


def test_a_shape_that_is_not_built_ends_the_mission(rig: type[Rig], starts: Starts) -> None:
    line = Mission(build_pattern("line", 4), name="line", then=Mission(build_pattern("tee", 4), name="tee"))
    run = rig(line, starts(1, 4), dies={"u3": (3.0, False)})
    status = run.run()
    assert (status.state, status.shape) == (MissionState.INCOMPLETE, "line")
    assert "u3" in status.reason


def test_shapes_that_do_not_follow_from_each_other_are_refused(rig: type[Rig]) -> None:
    then = Mission(build_pattern("tee", 5), name="tee of 5")
    with pytest.raises(SceneError, match="a tee of 5 is not built from an assembly of 4 units"):
        rig(Mission(build_pattern("line", 4), name="line of 4", then=then), {})
    broken = Mission(Shape.from_tree({"a": "root", "b": "a.front"}))
    with pytest.raises(SceneError, match="takes nobody"):
        rig(Mission(build_pattern("line", 2), then=broken), {})


def test_an_explicit_plan_runs_in_its_order(rig: type[Rig]) -> None:
    steps = [
        UndockStep(undock="c", name="leave"),
        DockStep(unit="a", to="b.rear", name="dock", after=("leave",)),
        MoveStep(move="c", pose=PoseSpec(x_m=-1.2, y_m=-0.9, yaw_deg=90), name="park", after=("leave",)),
    ]
    body = rig(Mission(), {}).setup.lanes.body
    X_WB = SE2(0.5, 0.2, 0.0)
    starts = {"a": SE2(-1.3, 0.9, 0.5), "b": X_WB, "c": body.docked(X_WB, "left")}
    run = rig(Mission(steps=steps, holders={"c": "b.left"}), starts)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == {"a": "b.rear"}
    X = run.units["c"].X_WU
    assert abs(X.x + 1.2) < 0.02
    assert abs(X.y + 0.9) < 0.02
    first = {}
    for k, message in enumerate(run.authorities):
        first.setdefault((message.unit, tuple(leg.kind for leg in message.legs)), k)
    left = next(k for (unit, kinds), k in first.items() if unit == "c" and kinds == (LegKind.BACK,))
    assert all(k > left for (unit, _), k in first.items() if unit == "a")


@pytest.mark.parametrize("ports", [("left", "right"), ("left", "right", "rear")])
def test_docked_units_change_places(ports: tuple[str, ...], rig: type[Rig], setup: CoordinationSetup) -> None:
    """Each is to dock where the next one is docked; one of them leaves its port, and the others go first."""
    names, hub = "abc"[: len(ports)], SE2(0.2, 0.1, 0.4)
    holders = {name: f"hub.{port}" for name, port in zip(names, ports, strict=True)}
    wanted = dict(zip(names, [*list(holders.values())[1:], holders["a"]], strict=True))
    steps = [DockStep(unit=name, to=port, after=()) for name, port in wanted.items()]
    poses = {name: setup.lanes.body.docked(hub, port) for name, port in zip(names, ports, strict=True)}
    run = rig(Mission(steps=steps, holders=holders), {"hub": hub, **poses})
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == wanted


@pytest.mark.parametrize(
    ("hub", "ports", "stays"),
    [
        (SE2(0.54, -0.39, math.radians(-174.0)), "right rear", False),
        (SE2(0.80, -0.47, math.radians(-92.0)), "rear left", False),
        (SE2(0.54, -0.39, math.radians(-174.0)), "right rear", True),
    ],
)
def test_a_target_goes_elsewhere_when_those_have_left_that_it_carries(
    hub: SE2, ports: str, stays: bool, rig: type[Rig], setup: CoordinationSetup
) -> None:
    """Its left port faces the border; it cannot drive while one is docked to it that has no step.

    Nobody docks to it before, though one could.
    """
    holders = {name: f"hub.{port}" for name, port in zip("bc", ports.split(), strict=True)}
    docked = {name: setup.lanes.body.docked(hub, port.removeprefix("hub.")) for name, port in holders.items()}
    steps = [DockStep(unit="b", to="hub.left", after=()), DockStep(unit="c", to="hub.right", after=())]
    run = rig(Mission(steps=steps[: 1 if stays else 2], holders=holders), {"hub": hub, **docked})
    status = run.run()
    assert status.state is (MissionState.INCOMPLETE if stays else MissionState.COMPLETE), status.reason
    assert run.joints == (holders if stays else {"b": "hub.left", "c": "hub.right"})
    moved = run.units["hub"].X_WU.inverse() @ hub
    assert (abs(moved.x) < 1e-9) is stays


def test_two_that_meet_head_on_pass_each_other(rig: type[Rig]) -> None:
    """In a lane for one, with idle units as its walls; neither waits for the other for ever."""
    walls = {f"w{k}": SE2(-0.6 + 0.4 * (k // 2), 0.45 * (-1) ** k, 0.0) for k in range(8)}
    starts = {"a": SE2(-1.6, 0.0, 0.0), "b": SE2(1.6, 0.0, 3.1), **walls}
    steps = [
        MoveStep(move="a", pose=PoseSpec(x_m=1.5, y_m=0.5, yaw_deg=0), after=()),
        MoveStep(move="b", pose=PoseSpec(x_m=-1.5, y_m=-0.5, yaw_deg=180), after=()),
    ]
    run = rig(Mission(steps=steps), starts)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason


def test_a_move_that_never_ends_where_it_should_is_given_up(rig: type[Rig]) -> None:
    steps = [MoveStep(move="a", pose=PoseSpec(x_m=0.5, y_m=0.0, yaw_deg=0))]
    run = rig(Mission(steps=steps), {"a": SE2(-0.5, 0.0, 0.0)})
    run.units["a"].slips_m = 0.1
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert f"a: routes were planned anew {status.replans} times" in status.reason


def test_a_root_that_misses_its_place_once_costs_one_plan_however_many_wait_for_it(
    rig: type[Rig], starts: Starts
) -> None:
    """Each route that ended for the want of it was counted: of sixteen units the mission was given up."""
    shape = build_pattern("cross", 6)
    run = rig(Mission(shape=shape), starts(3, 6))
    _run_until(run, lambda: any(unit.task == "p0" for unit in run.status.units))
    root = next(unit.unit for unit in run.status.units if unit.task == "p0")
    run.units[root].slips_m = 0.04
    _run_until(run, lambda: run.status.replans > 0)
    run.units[root].slips_m = 0.0
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(shape)
    assert status.replans == 1


@pytest.mark.parametrize("seed", [1, 14])
def test_a_root_that_misses_its_place_need_not_wait_until_all_have_come_as_far_as_they_may(
    seed: int, rig: type[Rig], starts: Starts
) -> None:
    """With the first seed it stood for 14 s; with the second one, a unit may get its next route meanwhile."""
    run = rig(Mission(shape=build_pattern("cross", 8)), starts(seed, 8))
    _run_until(run, lambda: any(unit.task == "p0" for unit in run.status.units))
    root = next(unit.unit for unit in run.status.units if unit.task == "p0")
    run.units[root].slips_m = 0.04
    _run_until(run, lambda: run.status.replans > 0)
    run.units[root].slips_m, missed_ns = 0.0, run.now_ns
    _run_until(run, lambda: run.units[root].route > 1)
    assert run.now_ns - missed_ns < 9e9


def test_a_unit_that_corrects_where_it_stands_has_not_missed_its_place(rig: type[Rig]) -> None:
    steps = [MoveStep(move="a", pose=PoseSpec(x_m=0.5, y_m=0.0, yaw_deg=0))]
    run = rig(Mission(steps=steps), {"a": SE2(-0.5, 0.0, 0.0)})
    unit = run.units["a"]
    unit.slips_m = 0.1
    _run_until(run, lambda: unit.route == 1 and unit.progress > unit.track.length - 1e-6)
    for _ in range(10):
        run.step()
    unit.slips_m = 0.0
    status = run.run()
    assert status.state is MissionState.COMPLETE
    assert status.replans == 0


def test_of_two_that_want_one_port_one_is_refused_with_the_reason(rig: type[Rig]) -> None:
    steps = [DockStep(unit=unit, to="b.rear", after=()) for unit in "ac"]
    starts = {"b": SE2(0.8, 0.0, 0.0), "a": SE2(-1.0, 0.7, 0.0), "c": SE2(-1.0, -0.7, 0.0)}
    run = rig(Mission(steps=steps), starts)
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert run.joints == {"a": "b.rear"}
    assert status.given_up == ("c",)
    assert "c cannot dock: b.rear is taken by a" in status.reason


def test_a_unit_docks_beside_one_that_holds_its_target_and_has_no_step(rig: type[Rig]) -> None:
    """The root of a plan stands as near to it in its seat as neighbours in a shape do."""
    steps = [DockStep(unit="b", to="a.rear"), DockStep(unit="c", to="b.left")]
    starts = {"a": SE2(0.9, 0.0, 0.0), "b": SE2(-0.6, -0.4, 0.3), "c": SE2(-0.9, 0.9, 0.0)}
    run = rig(Mission(steps=steps), starts)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == {"b": "a.rear", "c": "b.left"}


def test_nobody_sets_out_for_the_port_of_a_unit_that_has_failed(rig: type[Rig]) -> None:
    steps = [
        MoveStep(move="b", name="away", pose=PoseSpec(x_m=0.9), after=()),
        DockStep(unit="a", to="b.rear", after=()),
    ]
    starts = {"a": SE2(-1.4, 0.0, 0.0), "b": SE2(-0.2, 0.6, 0.0)}
    run = rig(Mission(steps=steps), starts, dies={"b": (2.0, False)})
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "a cannot dock: b has failed" in status.reason
    assert status.replans <= 1  # that of the route which it may have had by then


def test_one_behind_a_unit_that_undocks_makes_way(rig: type[Rig]) -> None:
    body = rig(Mission(), {}).setup.lanes.body
    X_WA = SE2(0.5, 0.0, 0.0)
    place = body.docked(X_WA, "rear")
    for distance in (0.3, 0.8):
        starts = {"a": X_WA, "b": place, "c": place @ SE2(-distance, 0.0, 0.0)}
        run = rig(Mission(steps=[UndockStep(undock="b")], holders={"b": "a.rear"}), starts)
        status = run.run()
        assert status.state is MissionState.COMPLETE, status.reason
        assert run.units["b"].holder is None
        assert run.units["c"].route == (1 if distance < 0.4 else 0)


def test_a_unit_that_carries_another_one_gets_no_route(rig: type[Rig]) -> None:
    body = rig(Mission(), {}).setup.lanes.body
    X_WA = SE2(0.5, 0.0, 0.0)
    starts = {"a": X_WA, "b": body.docked(X_WA, "rear")}
    steps = [MoveStep(move="a", pose=PoseSpec(x_m=-1.0))]
    run = rig(Mission(steps=steps, holders={"b": "a.rear"}), starts)
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "a carries b" in status.reason
    assert run.units["a"].route == 0


@pytest.mark.parametrize("target_first", [True, False])
def test_nobody_docks_to_a_unit_that_has_yet_to_drive(
    target_first: bool, rig: type[Rig], setup: CoordinationSetup
) -> None:
    """The two steps may be carried out in any order, and only one order of them can be."""
    steps = [MoveStep(move="b", name="away", pose=PoseSpec(x_m=0.9), after=()),
             DockStep(unit="a", to="b.rear", after=())]  # fmt: skip
    steps = steps if target_first else steps[::-1]
    assert [task.name for task in plan_tasks(steps, {}, setup.lanes)] == ["away", "a"]
    starts = {"a": SE2(-1.2, 0.0, 0.0), "b": SE2(-0.2, 0.6, 0.0)}
    run = rig(Mission(steps=steps), starts)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == {"a": "b.rear"}
    assert run.units["b"].X_WU.x == pytest.approx(0.9, abs=0.03)


def test_ground_is_not_freed_by_silence(rig: type[Rig], starts: Starts) -> None:
    """A unit that falls silent and out of sight keeps what it was granted: nobody is let onto it."""
    shape = build_pattern("cross", 5)
    silent = RadioSpec.model_validate({"silences": [{"from_s": 6.0, "until_s": 26.0, "units": ["u0", "u1"]}]})
    run = rig(Mission(shape=shape), starts(4, 5), radio=silent, sight=False)
    held: dict[tuple[str, int], float] = {}
    while run.now_ns < 25e9:
        run.step()
        for unit in run.status.units:
            if run.now_ns > 7e9 and unit.unit in ("u0", "u1") and unit.state is UnitState.UNDER_WAY:
                held.setdefault((unit.unit, unit.route), unit.progress)
                assert unit.progress == held[unit.unit, unit.route]
    assert held
    assert run.run().state is MissionState.COMPLETE


def test_a_shape_that_does_not_fit_ends_the_mission_with_the_reason(rig: type[Rig], starts: Starts) -> None:
    whole = rig(Mission(), {}).setup
    small = RouteFinder(whole.lanes.body, RouteParams(), (-1.1, 1.1, -1.0, 1.0))
    run = rig(Mission(shape=build_pattern("cross", 5)), starts(0, 5), setup=replace(whole, finder=small))
    status = run.run(20.0)
    assert status.state is MissionState.INCOMPLETE
    assert "do not fit" in status.reason
    with pytest.raises(SceneError, match="takes nobody"):
        rig(Mission(shape=Shape.from_tree({"a": "root", "b": "a.front"})), {})


def test_who_has_made_way_does_so_again_where_a_shape_is_placed_anew(rig: type[Rig]) -> None:
    """In a corridor; the root fails at the start, and for it they have made way as often as they may."""
    whole = rig(Mission(), {}).setup
    corridor = RouteFinder(whole.lanes.body, RouteParams(), (-1.3, 1.3, -0.5, 0.5))
    starts = {name: SE2(x, 0.0, 0.0) for name, x in (("a", 0.3), ("b", 1.0), ("c", -0.3), ("d", -1.0))}
    run = rig(Mission(shape=build_pattern("line", 2)), starts, setup=replace(whole, finder=corridor))
    run.units["d"].dead_s = 0.0
    while run.now_ns < 20e9 and not run.coordinator._siting.moves:
        for unit in run.coordinator._units.values():
            unit.evasions = 3
        run.step()
    assert run.coordinator._siting.moves == 1
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason


def test_a_unit_that_fails_without_a_task_takes_none_from_another(rig: type[Rig]) -> None:
    """One that a dead unit before it holds has lost its task to a spare, and fails while that one drives."""
    starts = {"a": SE2(0.9, 0.0, 3.1), "b": SE2(-0.3, 0.8, 0.0), "c": SE2(-1.5, -0.9, 0.0)}
    run = rig(Mission(shape=build_pattern("line", 2)), {**starts, "dead": SE2(1.7, 1.2, 0.0)})
    run.units["dead"].dead_s = -10.0
    units = [run.coordinator._units[name] for name in starts]
    _run_until(run, lambda: any(unit.task == "p1" for unit in units))
    held, spare = sorted((unit for unit in units if unit.task != "p0"), key=lambda unit: unit.task is None)
    run.units[held.name].held_routes = 99
    _run_until(run, lambda: run.coordinator._recall.is_recalled(held))
    run.units["dead"].X_WU = run.units[held.name].X_WU @ SE2(0.25, 0.0, 0.0)
    _run_until(run, lambda: spare.under_way and spare.task == "p1")
    run.units[held.name].dead_s = 1e-9 * run.now_ns
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert (spare.route, status.replans) == (1, 1)


def test_the_root_of_an_assembly_stays_where_it_is(rig: type[Rig]) -> None:
    """Also when nobody is docked to it any more, and the one that has left cannot come back."""
    tree = Shape.from_tree({"a": "root", "b": "a.left"})
    body = rig(Mission(), {}).setup.lanes.body
    X_WA = SE2(0.2, 0.0, 0.0)
    starts = {"a": X_WA, "b": body.docked(X_WA, "rear"), "dead": SE2(-1.7, 1.2, 0.0)}
    run = rig(Mission(shape=tree, holders={"b": "a.rear"}), starts)
    run.units["b"].held_routes, run.units["dead"].dead_s = 1, 0.0
    _run_until(run, lambda: run.coordinator._recall.is_recalled(run.coordinator._units["b"]))
    run.units["dead"].X_WU = body.docked(X_WA, "left") @ SE2(-0.2, 0.0, 0.0)
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "dead closes the lane to a.left" in status.reason
    root = next(unit for unit in status.units if unit.unit == "a")
    assert (root.state, root.route) == (UnitState.DOCKED, 0)


def _run_until(run: Rig, happened: Callable[[], bool]) -> None:
    while not happened():
        assert run.now_ns < 100e9
        run.step()


@pytest.mark.parametrize(
    ("steps", "b"),
    [
        ([DockStep(unit="a", to="b.rear")], SE2(-1.7, 0.0, 0.0)),
        # The second port is the one that nobody can reach, and after the first dock `b` drives no more.
        ([DockStep(unit="a", to="b.rear"), DockStep(unit="c", to="b.left")], SE2(0.0, 1.2, 0.0)),
        # Nor would `c` reach the port of `a`, once that is docked.
        ([DockStep(unit="a", to="b.right"), DockStep(unit="c", to="a.rear")], SE2(0.0, -0.7, 0.0)),
    ],
)
def test_a_target_goes_where_all_its_ports_can_be_reached(
    steps: list[DockStep], b: SE2, rig: type[Rig]
) -> None:
    """The border is in front of a port: units went to and fro between waiting places, and gave up."""
    run = rig(Mission(steps=steps), {"a": SE2(1.2, 0.5, 2.0), "b": b, "c": SE2(1.2, -0.6, 1.0)})
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == {step.unit: step.to for step in steps}
    assert run.units["b"].route == 1


@pytest.mark.parametrize(("held", "dies_s"), [(1, math.inf), (0, 4.0)])
def test_nobody_is_led_to_where_a_target_was_to_stand(held: int, dies_s: float, rig: type[Rig]) -> None:
    """`b` is stopped on its way out of a corner, and others are under way to where its ports would have been.

    They were granted the ground on which it stands, and the legs into its ports.
    """
    steps = [DockStep(unit=unit, to=f"b.{port}", after=()) for unit, port in zip("cde", PORTS, strict=True)]
    starts = {"b": SE2(-1.7, -1.2, 0.7), "c": SE2(1.2, 0.8, math.pi), "d": SE2(1.2, -0.9, 0.5)}
    run = rig(Mission(steps=steps), {**starts, "e": SE2(-0.2, 1.2, 0.5)})
    run.units["b"].held_routes, run.units["b"].held_m, run.units["b"].dies_s = held, 0.35, dies_s
    body = run.setup.lanes.body
    while run.status.state is MissionState.RUNNING:
        run.step()
        for step in steps:
            unit = run.units[step.unit]
            if unit.authority.length > unit.authority.dock_start >= unit.progress and unit.authority.newest:
                off = unit.track.end.inverse() @ body.docked(run.units["b"].X_WU, step.target_port)
                granted = unit.authority.newest.limit >= unit.authority.length
                assert not granted or math.hypot(off.x, off.y) < 0.1, f"{unit.name} is led past its port"
    status = run.status
    if held:
        assert status.state is MissionState.COMPLETE, status.reason
        assert run.joints == {step.unit: step.to for step in steps}
    else:
        assert status.state is MissionState.INCOMPLETE
        assert not run.joints
        assert "b has failed" in status.reason


def test_others_make_way_for_a_target_that_has_to_go_where_its_port_can_be_reached(rig: type[Rig]) -> None:
    """It stood in the corner, with its port at the border, between those that were packed beside it."""
    up = math.radians(90.0)
    starts = {
        "a": SE2(-1.8, -1.3, up),
        "b": SE2(-1.49, -1.3, up),
        "c": SE2(-1.8, -0.99, 0.0),
        "d": SE2(-1.49, -0.99, -up),
    }
    run = rig(Mission(steps=[DockStep(unit="b", to="a.left", port="front")]), starts)
    assert run.run().state is MissionState.COMPLETE, run.status.reason
    assert run.joints == {"b": "a.left"}


def test_a_target_that_the_plan_has_sent_too_near_to_the_border_is_sent_on(rig: type[Rig]) -> None:
    """The only other way would be to give up."""
    steps = [MoveStep(move="b", name="away", pose=PoseSpec(x_m=-1.55)), DockStep(unit="a", to="b.rear")]
    starts = {"a": SE2(1.2, 0.5, 2.0), "b": SE2(0.0, 0.0, 0.0), "c": SE2(1.2, -0.6, 1.0)}
    run = rig(Mission(steps=steps), starts)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.units["b"].route == 2
    assert run.units["c"].route == 0, "it is in nobody's way"


def test_a_turn_that_nobody_has_driven_is_not_over(setup: CoordinationSetup) -> None:
    """One of 13 mm at the wheels counted as driven, and was granted and counted anew every 0.2 s."""
    builder = TrackBuilder(SE2(), setup.lanes.body.offset)
    builder.turn_to(0.1)
    unit = UnitRecord("a", SE2(), state=UnitState.UNDER_WAY, track=builder.track(), seen_ns=1)
    assert 0.0 < builder.track().length < SAME_M
    for progress, arrived in ((0.0, False), (builder.track().length, True)):
        unit.progress, unit.X_WU = progress, builder.track().at(progress)
        unit.report = UnitReport("a", 1, 1, 0, progress, UnitMode.STANDING, None)
        assert Watch(Patience()).has_arrived(unit, 1) is arrived
