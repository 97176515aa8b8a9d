"""Hops that cannot be made give way to others: by those that can move, past the obstacles known now."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from msrr_control.coordination import siting
from msrr_control.coordination.mission import Mission
from msrr_control.shapes.hop_rules import HopRules
from msrr_control.shapes.reconfiguration import assembly_ports, shape_ports, tasks_from
from msrr_control.shapes.shape import Shape, build_pattern
from msrr_control.shapes.tasks import Task
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import MissionState, UnitState

Rig = Any

#: A fork that becomes a line: e docks to b, d to e and c to d.
FORK = {"b": "a.rear", "c": "a.left", "d": "a.right", "e": "c.rear"}
#: b and c change places, and b steps aside to the rear of d.
SWAP = {"b": "a.left", "c": "a.right", "d": "a.rear"}
SWAPPED = Shape.from_tree({"a": "root", "d": "a.rear", "c": "a.left", "b": "a.right"})


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of tasks that each new search has found."""
    found: list[int] = []

    def counted(*args: Any) -> tuple[list[Task], bool]:
        found.append(0)
        tasks, whole = tasks_from(*args)
        found[-1] = len(tasks)
        return tasks, whole

    monkeypatch.setattr(siting, "tasks_from", counted)
    return found


#: Where spare units stand free.
NEAR, FAR = SE2(0.0, 1.2, 0.0), SE2(-1.4, -1.1, 0.0)


def _assembled(
    rig: type[Rig], holders: dict[str, str], shape: Shape, named: bool = False, **spares: SE2
) -> Rig:
    body = rig(Mission(), {}).setup.lanes.body
    starts = Shape.from_tree({"a": "root", **holders}).poses(SE2(0.7, 0.0, 0.0), body)
    return rig(Mission(shape=shape, holders=holders, named=named), starts | spares)


def _run_until(run: Rig, happened: Callable[[], bool]) -> None:
    while not happened():
        assert run.now_ns < 100e9
        run.step()


def _post(X_WB: SE2) -> ObstacleEstimate:
    return ObstacleEstimate("post", 0, X_WB, np.eye(3), 0.05)


def test_a_port_before_which_an_obstacle_appears_is_not_stepped_aside_to(
    rig: type[Rig], searches: list[int]
) -> None:
    """The unit was led back, and its next hop was given up, for which it had no need to dock there."""
    run = _assembled(rig, SWAP, SWAPPED, named=True)
    _run_until(run, lambda: run.units["b"].holder is None)
    run.obstacles = (_post(run.units["d"].X_WU @ SE2(-0.65, 0.0, 0.0)),)
    _run_until(run, lambda: not any(unit.state is UnitState.UNDER_WAY for unit in run.status.units))
    run.step()
    assert searches, "nobody waits for an obstacle to go that is in the lane of the next hop"
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == {"d": "a.rear", "c": "a.left", "b": "a.right"}
    assert sorted(status.done) == ["b to a.right", "c to a.left"]
    assert searches == [2]


def test_hops_are_searched_for_once_where_what_they_rest_on_changes_once(
    rig: type[Rig], searches: list[int]
) -> None:
    """Not at all where no hop is in the way of what has changed; and no way is no reason to search on."""
    run = _assembled(rig, SWAP, SWAPPED, named=True)
    _run_until(run, lambda: run.units["b"].holder is None)
    run.obstacles = (_post(SE2(-1.7, 1.2)),)
    assert run.run().state is MissionState.COMPLETE
    assert searches == []
    run = _assembled(rig, SWAP, SWAPPED, named=True)
    run.obstacles = (_post(SE2(-1.7, 1.2)),)
    run.units["b"].dead_s = 0.0
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "b failed" in status.reason or "b has failed: seized" in status.reason
    assert searches == [0]
    assert run.now_ns < 30e9


@pytest.mark.parametrize("in_port", [True, False])
def test_others_hop_to_where_one_that_has_failed_was_to_be(
    in_port: bool, rig: type[Rig], searches: list[int]
) -> None:
    """All other hops were given up with the first one, which they were to come after."""
    line = build_pattern("line", 5)
    run = _assembled(rig, FORK, line)
    if not in_port:
        _run_until(run, lambda: run.units["e"].holder is None)
    run.units["e"].dead_s = 1e-9 * run.now_ns
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "seized" in status.reason
    # In its port it keeps its carrier there; outside it stands in the way of that one.
    assert status.given_up == ("e to b.rear", "c to e.rear")
    assert status.done == ("d to b.rear",)
    assert searches == [1]


def test_one_that_is_found_again_hops_after_all(rig: type[Rig], searches: list[int]) -> None:
    """The others have begun to fill the places of the line without it."""
    line = build_pattern("line", 5)
    run = _assembled(rig, FORK, line)
    _run_until(run, lambda: run.units["e"].progress > 1.0)
    run.units["e"].hidden_s = (1e-9 * run.now_ns, math.inf)
    _run_until(run, lambda: searches == [2])
    run.units["e"].hidden_s = (0.0, 0.0)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(line)
    assert status.given_up == ()
    assert searches == [2, 1]


def test_a_spare_unit_takes_the_place_of_one_that_has_failed(rig: type[Rig], searches: list[int]) -> None:
    """The nearest one; they were left where they stood, and the mission ended as incomplete."""
    line = build_pattern("line", 5)
    run = _assembled(rig, FORK, line, far=FAR, near=NEAR)
    _run_until(run, lambda: run.units["e"].progress > 1.0)
    run.units["e"].dead_s = 1e-9 * run.now_ns
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(line)
    assert run.joints.keys() == {"b", "c", "d", "near"}
    assert run.units["far"].X_WU == FAR
    assert status.given_up == ()
    assert searches == [3]


def test_so_does_the_next_one_where_the_first_one_fails_too(rig: type[Rig], searches: list[int]) -> None:
    line = build_pattern("line", 5)
    run = _assembled(rig, FORK, line, far=FAR, near=NEAR)
    _run_until(run, lambda: run.units["e"].progress > 1.0)
    run.units["e"].dead_s = 1e-9 * run.now_ns
    _run_until(run, lambda: run.units["near"].progress > 0.2)
    run.units["near"].dead_s = 1e-9 * run.now_ns
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.is_built(line)
    assert "far" in run.joints


def test_a_spare_fills_a_place_where_one_that_failed_stays_in_a_port_beside_the_shape(rig: type[Rig]) -> None:
    """All places are taken, and it is locked to the shape, so that the mission is not complete."""
    line = build_pattern("line", 5)
    run = _assembled(rig, FORK, line, near=NEAR)
    run.units["d"].dead_s = 0.0
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert "seized" in status.reason
    rears = {unit for unit, port in run.joints.items() if port.endswith(".rear")}
    assert rears == {"b", "c", "e", "near"}
    assert run.joints["d"] == "a.right"


def test_places_with_names_are_nobody_elses(rig: type[Rig]) -> None:
    run = _assembled(rig, SWAP, SWAPPED, named=True, near=NEAR)
    _run_until(run, lambda: run.units["b"].holder is None)
    run.units["b"].dead_s = 1e-9 * run.now_ns
    assert run.run().state is MissionState.INCOMPLETE
    assert run.units["near"].X_WU == NEAR


def test_spares_also_take_the_place_of_a_unit_that_has_to_carry_one_that_has_failed(rig: type[Rig]) -> None:
    """It has failed in its port before the next shape, to which the hops are chosen as if it could leave."""
    line, side = build_pattern("line", 4), {"b": "a.left", "c": "a.right", "d": "c.right"}
    start = {"b": "a.rear", "c": "a.left", "d": "a.right"}
    run = _assembled(rig, start, line, near=NEAR, far=NEAR @ SE2(0.0, -2.4, 0.0))
    then = Mission(shape=Shape.from_tree({"a": "root", **side}), name="side")
    starts = {unit: SE2(-0.5, 0.0, 0.0) @ X for unit, X in run.starts.items()}
    run = rig(replace(run.mission, then=then), starts)
    _run_until(run, lambda: run.units["c"].holder == "b.rear" and len(run.status.done) == 1)
    run.units["c"].dead_s = 1e-9 * run.now_ns
    status = run.run()
    assert status.state is MissionState.INCOMPLETE
    assert status.shape == "side"
    assert "c has failed: seized" in status.reason
    taken = assembly_ports(run.joints)
    assert set(shape_ports(then.shape).values()) <= set(taken.values())
    assert (taken["b"], taken["c"]) == (("rear",), ("rear", "rear"))


def _grown(rules: HopRules, rng: random.Random, names: str = "abcde") -> Shape:
    """Units that have docked one after another wherever they could."""
    form = {(): names[0]}
    for name in names[1:]:
        free = [(*holder, port) for holder in form for port in ("rear", "left", "right")]
        free = [p for p in free if p not in form and not any(rules.closes(p, other) for other in form)]
        form[rng.choice(free)] = name
    tree = {name: f"{form[p[:-1]]}.{p[-1]}" if p else "root" for p, name in form.items()}
    return Shape.from_tree(tree)


@pytest.mark.nightly
def test_missions_with_spares_end_and_are_complete_only_where_the_shape_stands(rig: type[Rig]) -> None:
    """Anybody fails anywhere: in its port, on its way or at the next port. The judge is the rig's truth."""
    ends: list[tuple[MissionState, bool]] = []
    for seed in range(120):
        rng, setup = random.Random(seed), rig(Mission(), {}).setup
        rules = HopRules(setup.lanes, SE2(), (-9.0, 9.0, -9.0, 9.0))
        start, shape = _grown(rules, rng), _grown(rules, rng)
        holders = {place.name: f"{place.parent}.{place.port}" for place in start.places[1:]}
        X_WR = SE2(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(-math.pi, math.pi))
        spares = {"x": SE2(-1.6, rng.uniform(-1.1, 1.1)), "y": SE2(1.6, rng.uniform(-1.1, 1.1))}
        starts = start.poses(X_WR, setup.lanes.body) | spares
        run = rig(Mission(shape=shape, holders=holders), starts)
        unit, at = run.units[rng.choice("bcde")], rng.choice([-1.0, 0.1, 0.5, 1.0])
        while run.status.state is MissionState.RUNNING:
            assert run.now_ns < 400e9, f"seed {seed}"
            run.step()
            if unit.dead_s is None and unit.progress > at and (unit.holder is None or at < 0.0):
                unit.dead_s = 1e-9 * run.now_ns
        ends.append((run.status.state, bool(run.joints) and run.is_built(shape)))
        assert ends[-1] != (MissionState.COMPLETE, False), f"seed {seed}: {run.status.reason}"
        assert run.status.reason
        if unit.holder is None and unit.dead_s is not None:
            assert ends[-1] != (MissionState.INCOMPLETE, True), f"seed {seed}: {run.status.reason}"
    assert ends.count((MissionState.COMPLETE, True)) > 20
