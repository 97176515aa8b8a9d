"""The order of a plan: what its author wrote holds, and lanes decide what that leaves open."""

from __future__ import annotations

import math
from graphlib import CycleError, TopologicalSorter
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.tasks import plan_tasks
from msrr_control.tracks.route_params import RouteParams
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.messages.coordination import MissionState
from msrr_scenes.specs.plan import DockStep, MoveStep, UndockStep
from msrr_scenes.specs.spec import PoseSpec

Rig = Any
Plan = tuple[list[DockStep], dict[str, SE2]]

#: A tree in which u7 closes the lane of u3, of which it knows nothing by those that carry it.
TREE = {"u1": "u0.left", "u2": "u1.rear", "u3": "u0.rear", "u4": "u2.right",
        "u5": "u4.rear", "u6": "u5.rear", "u7": "u6.right"}  # fmt: skip


@pytest.fixture(scope="module")
def wide() -> CoordinationSetup:
    """The shipped unit in an arena of 5 m by 4 m."""
    return CoordinationSetup.of(read_unit(find_urdf("unit.urdf")), RouteParams(), (-2.5, 2.5, -2.0, 2.0))


def random_plan(seed: int, setup: CoordinationSetup) -> Plan | None:
    """Four units dock to three that stand anywhere; None unless their order matters and there is one."""
    rng, body, lanes = np.random.default_rng(seed), setup.lanes.body, setup.lanes

    def drawn(others: dict[str, SE2], x: float, y: float, apart: float) -> SE2:
        while True:
            X = SE2(*rng.uniform([-x, -y, -math.pi], [x, y, math.pi]))
            if all(math.hypot(X.x - o.x, X.y - o.y) > apart for o in others.values()):
                return X

    there: dict[str, SE2] = {}
    for k in range(7):
        there[f"u{k}"] = drawn(there, 1.0, 0.7, 0.45) if k < 3 else drawn(there, 2.2, 1.7, 0.6)
    roots = list(there)[:3]
    ends: dict[str, SE2] = {}
    for k in rng.permutation(9).tolist():
        root, port = roots[k // 3], ("rear", "left", "right")[k % 3]
        X = body.docked(there[root], port)
        far = [X, lanes.end(X)]
        inside = all(abs(pose.x) < 2.0 and abs(pose.y) < 1.5 for pose in far)
        others = [there[other] for other in roots if other != root]
        clear = not any(lanes.closed_by(X, other) or body.gap(X, other) < 0.05 for other in others)
        if inside and clear and all(body.gap(X, end) > 0.05 for end in ends.values()) and len(ends) < 4:
            ends[f"{root}.{port}"] = X
    closes = [(a, b) for a, b in permutations(ends, 2) if lanes.closed_by(ends[a], ends[b])]
    try:
        TopologicalSorter({b: [a for a, other in closes if other == b] for b in ends}).prepare()
    except CycleError:
        return None
    steps = [DockStep(unit=f"u{k + 3}", to=port, after=()) for k, port in enumerate(ends)]
    return (steps, there) if closes and len(steps) == 4 else None


def random_plans(seeds: range, setup: CoordinationSetup) -> list[Plan]:
    found = [random_plan(seed, setup) for seed in seeds]
    return [plan for plan in found if plan is not None]


@pytest.fixture(scope="module")
def plans(wide: CoordinationSetup) -> list[Plan]:
    return random_plans(range(150), wide)


def test_in_the_order_of_a_plan_every_lane_is_open(plans: list[Plan], wide: CoordinationSetup) -> None:
    """The law that the order stands for, step by step; in the order of the list many would find a body."""
    lanes, as_listed = wide.lanes, 0
    assert len(plans) >= 20
    for steps, there in plans:
        tasks = plan_tasks(steps, {}, lanes, there)
        by_name = {step.label: step for step in steps}
        for ordered in (True, False):
            standing: list[SE2] = []
            closed = 0
            for name in [task.name for task in tasks] if ordered else by_name:
                step = by_name[name]
                X = lanes.body.docked(there[step.target_unit], step.target_port)
                closed += any(lanes.closed_by(X, other) for other in standing)
                standing.append(X)
            assert not (ordered and closed)
            as_listed += closed > 0
    assert as_listed > len(plans) // 3


@pytest.mark.parametrize("which", range(3))
def test_a_plan_whose_list_closes_a_lane_is_completed(
    which: int, plans: list[Plan], wide: CoordinationSetup, rig: type[Rig]
) -> None:
    differ = [
        plan
        for plan in plans
        if [t.name for t in plan_tasks(*_with(plan, wide))] != [step.label for step in plan[0]]
    ]
    steps, there = differ[which]
    run = rig(Mission(steps=steps), there, setup=wide)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == {step.unit: step.to for step in steps}


def _with(plan: Plan, setup: CoordinationSetup) -> tuple[Any, ...]:
    return plan[0], {}, setup.lanes, plan[1]


def test_what_the_author_wrote_holds_whatever_the_lanes(plans: list[Plan], wide: CoordinationSetup) -> None:
    for steps, there in plans:
        last = next(task for task in plan_tasks(steps, {}, wide.lanes, there) if task.behind)
        first = last.behind[0]
        turned = [s.model_copy(update={"after": (last.name,)}) if s.label == first else s for s in steps]
        order = [task.name for task in plan_tasks(turned, {}, wide.lanes, there)]
        assert order.index(last.name) < order.index(first)


def _steps(*order: str, **after: tuple[str, ...]) -> list[DockStep]:
    return [DockStep(unit=unit, to=TREE[unit], after=after.get(unit, ())) for unit in order]


def test_units_that_are_locked_to_each_other_need_not_be_seen(wide: CoordinationSetup) -> None:
    for order in ("u1", "u2", "u3", "u4", "u5", "u6", "u7"), ("u7", "u6", "u5", "u4", "u2", "u1", "u3"):
        tasks = [task.name for task in plan_tasks(_steps(*order), {}, wide.lanes)]
        assert tasks.index("u3") < tasks.index("u7")


def test_an_order_that_closes_a_lane_is_refused_and_the_steps_are_named(wide: CoordinationSetup) -> None:
    text = r"step 'u3' cannot be done: 'u7' stands in the lane .* since step 'u7'; change `after`"
    with pytest.raises(SceneError, match=text):
        plan_tasks(_steps(*TREE, u3=("u7",)), {}, wide.lanes)
    held = {unit: port for unit, port in TREE.items() if unit != "u3"}
    steps = [DockStep(unit="u3", to=TREE["u3"], after=()), UndockStep(undock="u7", after=())]
    with pytest.raises(SceneError, match=r"'u7' stands in the lane .* since the start"):
        plan_tasks(steps[:1], held, wide.lanes)
    # One that leaves frees the lane.
    assert [task.name for task in plan_tasks(steps, held, wide.lanes)] == ["u7", "u3"]


def test_a_unit_that_carries_others_makes_way_for_none_of_them(wide: CoordinationSetup) -> None:
    """Two units bend back beside it, and a third one has to come from where it stands."""
    moves = MoveStep(move="d", pose=PoseSpec(x_m=0.5), after=())
    g, b, e = (
        DockStep(unit=unit, to=to, after=())
        for unit, to in (("g", "d.rear"), ("b", "g.left"), ("e", "b.left"))
    )
    for steps, held, since in (
        ([g, b, e], {}, "the start"),
        ([e], {"g": "d.rear", "b": "g.left"}, "the start"),
        ([moves, g, b, e], {}, "step 'd'"),
    ):
        with pytest.raises(SceneError, match=f"'e' cannot be done: 'd' stands in the lane .* since {since}"):
            plan_tasks(steps, held, wide.lanes)
    beside = DockStep(unit="e", to="b.right", after=())
    assert [task.name for task in plan_tasks([moves, g, b, beside], {}, wide.lanes)] == ["d", "g", "b", "e"]


def test_a_unit_that_leaves_goes_before_one_that_docks_behind_it(
    rig: type[Rig], wide: CoordinationSetup
) -> None:
    """And before one that drives there, whose end the plan names."""
    body = wide.lanes.body
    X_WA = SE2(0.5, 0.0, 0.0)
    place = body.docked(X_WA, "rear")
    behind = place @ SE2(-0.45, 0.0, 0.0)
    out = UndockStep(undock="b", after=())
    there = {"a": X_WA, "b": place, "c": SE2(-1.8, 1.2, 0.0)}
    pose = PoseSpec(x_m=behind.x, y_m=behind.y, yaw_deg=90)
    tasks = plan_tasks([MoveStep(move="c", pose=pose, after=()), out], {"b": "a.rear"}, wide.lanes, there)
    assert [task.name for task in tasks] == ["b", "c"]
    X_WD = behind @ SE2(0.0, 0.3, math.pi / 2)
    dock = DockStep(unit="c", to="d.rear", after=())
    run = rig(Mission(steps=[dock, out], holders={"b": "a.rear"}), there | {"d": X_WD}, setup=wide)
    status = run.run()
    assert status.state is MissionState.COMPLETE, status.reason
    assert run.joints == {"c": "d.rear"}


@pytest.mark.nightly
def test_random_plans_are_completed(wide: CoordinationSetup, rig: type[Rig]) -> None:
    """All but those in which a unit to be docked to was sent out of the way: its lanes are new."""
    plans, complete = random_plans(range(300), wide), 0
    for steps, there in plans:
        run = rig(Mission(steps=steps), there, setup=wide)
        status = run.run()
        moved = any(run.units[step.target_unit].route > 0 for step in steps)
        assert status.state is MissionState.COMPLETE or moved, status.reason
        complete += status.state is MissionState.COMPLETE
    assert complete > 0.9 * len(plans)
