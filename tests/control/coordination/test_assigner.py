"""Who gets which task: each the unit that it names, the others by their ways, and first what can be begun."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_control.coordination.assigner import Assigner
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.task_ends import TaskEnds
from msrr_control.coordination.task_list import TaskList
from msrr_control.shapes.tasks import Task, TaskKind
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import UnitState

ROOT = Task("r", TaskKind.MOVE, pose=SE2(), stays=True)
REAR = Task("rear", TaskKind.DOCK, parent="r", port="rear", stays=True)
BEHIND_REAR = Task("next", TaskKind.DOCK, parent="rear", port="rear", stays=True)
LEFT = Task("left", TaskKind.DOCK, parent="r", port="left", stays=True)


POST = ObstacleEstimate("post", 0, SE2(-0.6, 0.0, 0.0), np.eye(3), 0.08)


def _assigner(setup: CoordinationSetup, *units: UnitRecord, post: bool = False) -> Assigner:
    """Who assigns these units, with a post in the lane of the rear port of the root or without one."""
    named = {unit.name: unit for unit in units}
    ends = TaskEnds(setup, named)
    ends.obstacles = (POST,) if post else ()
    return Assigner(setup, named, ends)


def _built(*tasks: Task) -> TaskList:
    """Tasks of a shape whose root stands."""
    listed = TaskList([ROOT, *tasks])
    listed.grant("r")
    listed.finish("r")
    return listed


def _root() -> UnitRecord:
    return UnitRecord("root", SE2(), state=UnitState.DOCKED, task="r")


def test_whoever_stands_free_and_has_been_seen_may_take_any_task(setup: CoordinationSetup) -> None:
    free = UnitRecord("free", SE2())
    others = [UnitRecord(state.value, SE2(), state=state) for state in UnitState if state is not free.state]
    hangs = UnitRecord("hangs", SE2(), holder=("free", "rear"))
    assert _assigner(setup, UnitRecord("unseen"), *others, hangs, free).idle() == [free]


def test_a_unit_that_has_missed_a_place_gets_it_again_after_the_others(setup: CoordinationSetup) -> None:
    """Also where the choice of the site had wanted it there."""
    near, far = UnitRecord("near", SE2(-1.2, 0.0, 0.0)), UnitRecord("far", SE2(-1.5, 1.0, 3.0))
    assigner, tasks = _assigner(setup, near, far), TaskList([ROOT])
    assigner.wanted = {"r": "near"}
    assert assigner.assignment(tasks) == {"r": "near"}
    tasks.grant("r")
    tasks.miss("r", "near")
    assert assigner.assignment(tasks) == {"r": "far"}
    tasks.grant("r")
    tasks.miss("r", "far")
    assert assigner.assignment(tasks) == {"r": "near"}
    assert _assigner(setup, near).assignment(tasks) == {"r": "near"}


def test_the_unit_that_a_task_names_gets_that_one_and_no_other(setup: CoordinationSetup) -> None:
    """Although it stands at the end of the other one, too."""
    near, far = UnitRecord("near", SE2(1.0, 0.0, 0.0)), UnitRecord("far", SE2(-1.5, 1.0, 0.0))
    named = Task("named", TaskKind.MOVE, "near", pose=SE2(0.0, 1.0, 0.0))
    tasks = TaskList([Task("free", TaskKind.MOVE, pose=SE2(1.0, 0.0, 0.0)), named])
    assert _assigner(setup, near, far).assignment(tasks) == {"named": "near", "free": "far"}
    assert _assigner(setup, near).assignment(tasks) == {"named": "near"}


@pytest.mark.parametrize("swapped", [False, True])
def test_each_task_goes_to_the_unit_with_the_short_way(swapped: bool, setup: CoordinationSetup) -> None:
    ends = SE2(-1.5, 0.0, 0.0), SE2(1.5, 0.0, 0.0)
    a, b = (UnitRecord(name, X) for name, X in zip("ab", ends[::-1] if swapped else ends, strict=True))
    tasks = TaskList([Task(f"to {k}", TaskKind.MOVE, pose=X) for k, X in enumerate(ends)])
    first, second = ("b", "a") if swapped else ("a", "b")
    assigner = _assigner(setup, a, b)
    assert assigner.assignment(tasks) == {"to 0": first, "to 1": second}
    # The choice of where the shape stands holds, but only while all whom it names are idle.
    assigner.wanted = {"to 0": second, "to 1": first}
    assert assigner.assignment(tasks) == assigner.wanted
    assigner.wanted = {"to 0": second, "to 1": "failed"}
    assert assigner.assignment(tasks) == {"to 0": first, "to 1": second}


def test_where_nobody_knows_where_a_task_ends_any_unit_may_have_it(setup: CoordinationSetup) -> None:
    task = Task("to c", TaskKind.DOCK, parent_unit="c", port="rear")
    assigner = _assigner(setup, UnitRecord("a", SE2(1.0, 0.0, 0.0)), UnitRecord("c"))
    assert assigner.assignment(TaskList([task])) == {"to c": "a"}


@pytest.mark.parametrize(
    ("closed_by", "first"), [("nothing", "rear"), ("a unit in the port", "left"), ("a post", "left")]
)
@pytest.mark.parametrize("between", [(), (BEHIND_REAR,)])
def test_what_nobody_can_begin_now_and_what_comes_after_that_waits(
    closed_by: str, first: str, between: tuple[Task, ...], setup: CoordinationSetup
) -> None:
    """There are fewer units than tasks."""
    units = [_root(), UnitRecord("a", SE2(-1.5, 1.0, 0.0))]
    if closed_by == "a unit in the port":
        seat = setup.lanes.body.docked(SE2(), "rear")
        units.append(UnitRecord("in", seat, state=UnitState.DOCKED, holder=("root", "rear")))
    assigner = _assigner(setup, *units, post=closed_by == "a post")
    assert assigner.assignment(_built(REAR, *between, LEFT)) == {first: "a"}


def test_a_task_behind_one_that_nobody_can_begin_waits_as_well(setup: CoordinationSetup) -> None:
    seat = setup.lanes.body.docked(SE2(), "rear")
    taken = UnitRecord("in", seat, state=UnitState.DOCKED, holder=("root", "rear"))
    assigner = _assigner(setup, _root(), UnitRecord("a", SE2(-1.5, 1.0, 0.0)), taken)
    late = Task("late", TaskKind.DOCK, parent="r", port="right", behind=("rear",), stays=True)
    assert assigner.assignment(_built(REAR, late, LEFT)) == {"left": "a"}
