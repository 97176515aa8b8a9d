"""Tasks: a plan as a graph, what can be granted when, and what falls with what."""

from __future__ import annotations

from typing import get_args

import pytest

from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.task_list import TaskList
from msrr_control.shapes.shape import build_pattern
from msrr_control.shapes.tasks import Task, TaskKind, TaskState, plan_tasks, shape_tasks
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.mission import AssembledPair, Pattern, RadioSpec
from msrr_scenes.specs.plan import DockStep, MoveStep, UndockStep


def _dock(name: str, parent: str | None, *behind: str) -> Task:
    return Task(name, TaskKind.DOCK, parent=parent, port="rear", behind=behind)


def test_a_plan_keeps_its_graph_and_the_order_of_every_unit(setup: CoordinationSetup) -> None:
    steps = [
        DockStep(unit="a", to="b.rear", name="first", after=("last",)),
        UndockStep(undock="c", name="out", after=()),
        MoveStep(move="c", name="last"),  # after the step before it
        DockStep(unit="a", to="d.left", after=()),
    ]
    tasks = plan_tasks(steps, {}, setup.lanes)
    assert [task.name for task in tasks] == ["out", "last", "first", "a"]
    by_name = {task.name: task for task in tasks}
    assert by_name["last"].after == ("out",)
    assert by_name["a"].after == ("first",)
    assert by_name["first"].parent_unit == "b"
    assert by_name["out"].kind is TaskKind.UNDOCK


@pytest.mark.parametrize(
    ("steps", "reason"),
    [
        ([MoveStep(move="a", after=("x",))], "comes after 'x'"),
        ([MoveStep(move="a", name="x", after=("y",)), MoveStep(move="b", name="y", after=("x",))], "ring"),
        ([MoveStep(move="a", name="x"), MoveStep(move="b", name="x")], "two steps"),
    ],
)
def test_a_plan_that_cannot_be_followed_is_refused(
    steps: list[MoveStep], reason: str, setup: CoordinationSetup
) -> None:
    with pytest.raises(SceneError, match=reason):
        plan_tasks(steps, {}, setup.lanes)


@pytest.mark.parametrize("pattern", get_args(Pattern))
def test_the_tasks_of_a_shape_are_its_places_in_an_order_that_keeps_lanes_open(
    pattern: Pattern, setup: CoordinationSetup
) -> None:
    shape, X_WR = build_pattern(pattern, 7), SE2(0.3, -0.2, 1.0)
    poses = shape.poses(X_WR, setup.lanes.body)
    for named in (False, True):
        tasks = shape_tasks(shape, setup.lanes, named, X_WR)
        assert {task.name for task in tasks} == set(poses)
        assert (tasks[0].name, tasks[0].kind, tasks[0].pose) == (shape.root.name, TaskKind.MOVE, X_WR)
        earlier: list[str] = []
        for task in tasks:
            place = shape.by_name[task.name]
            assert task.unit == (task.name if named else None)
            assert task.stays
            assert (task.parent, task.port) == (place.parent, place.port)
            assert set(task.behind) <= set(earlier)
            assert (task.parent is None) is (task.kind is TaskKind.MOVE)
            assert task.parent is None or task.parent in task.behind
            others = [name for name in earlier if name != place.parent]
            if place.parent is not None:
                assert not any(setup.lanes.closed_by(poses[task.name], poses[name]) for name in others)
            later = [name for name in poses if name not in (*earlier, task.name, place.parent)]
            closing = [n for n in later if setup.lanes.closed_by(poses[task.name], poses[n]) and place.parent]
            behind = {t.name: _ancestors(t.name, tasks) for t in tasks}
            assert all(task.name in behind[name] for name in closing)
            earlier.append(task.name)


def _ancestors(name: str, tasks: list[Task]) -> set[str]:
    """All tasks that have to be granted before one."""
    task = next(task for task in tasks if task.name == name)
    return {name}.union(*(_ancestors(other, tasks) for other in task.behind))


def test_only_what_goes_before_holds_a_task_back() -> None:
    tasks = TaskList([_dock("a", None), _dock("b", "a", "a"), Task("c", TaskKind.MOVE, after=("b",))])
    assert [task.name for task in tasks.ready()] == ["a"]
    tasks.grant("a")
    assert [task.name for task in tasks.ready()] == ["b"]
    tasks.grant("b")
    assert tasks.ready() == []  # c comes after b, not only behind it
    tasks.finish("b")
    assert [task.name for task in tasks.ready()] == ["c"]
    assert not tasks.ended


def test_what_depends_on_a_lost_task_is_lost_with_it_and_nothing_else() -> None:
    tasks = TaskList(
        [_dock("a", None), _dock("b", "a", "a"), _dock("c", "b", "b"), _dock("d", "a", "a", "c")]
    )
    tasks.give_up("b", "no way")
    assert tasks.names(TaskState.GIVEN_UP) == ("b", "c")
    assert tasks.reasons == {"b": "no way", "c": "needs b"}
    tasks.grant("a")
    # d only let c go first: with c given up nothing holds it back.
    assert [task.name for task in tasks.ready()] == ["d"]


def test_a_task_is_open_for_others_until_too_many_have_failed_at_its_port() -> None:
    tasks = TaskList([_dock("a", None), Task("named", TaskKind.MOVE, unit="u")])
    for _ in range(2):
        tasks.grant("a")
        tasks.fail("a", "the port is plugged", in_dock_leg=True)
        assert tasks.state("a") is TaskState.OPEN
    for _ in range(5):  # on their way there, for which the port is not to blame
        tasks.grant("a")
        tasks.fail("a", "seized", in_dock_leg=False)
        assert tasks.state("a") is TaskState.OPEN
    tasks.grant("a")
    tasks.fail("a", "the port is plugged", in_dock_leg=True)
    assert tasks.state("a") is TaskState.GIVEN_UP
    tasks.grant("named")
    tasks.fail("named", "seized", in_dock_leg=False)  # nobody else may do it
    assert tasks.state("named") is TaskState.GIVEN_UP
    assert tasks.ended


def test_a_granted_task_whose_base_is_open_again_has_lost_it() -> None:
    tasks = TaskList([_dock("a", None), _dock("b", "a", "a"), _dock("c", "a", "b")])
    for name in ("a", "b", "c"):
        tasks.grant(name)
    assert tasks.lost_base("c") is None
    tasks.reopen("a")
    assert tasks.lost_base("b") == "a"
    assert tasks.lost_base("c") == "a"
    tasks.reopen("c")
    assert [task.name for task in tasks.ready()] == ["a"]  # b has lost its base: nothing goes behind it
    for name in ("a", "c"):
        tasks.grant(name)
    tasks.reopen("b")
    assert tasks.lost_base("c") == "b"
    assert tasks.lost_base("a") is None


def test_nothing_is_granted_behind_what_has_lost_its_base() -> None:
    """Through any number of others that have their routes."""
    tasks = TaskList([_dock("a", None), _dock("b", "a", "a"), _dock("c", None, "b"), _dock("d", None, "c")])
    for name in ("a", "b", "c"):
        tasks.grant(name)
    assert [task.name for task in tasks.ready()] == ["d"]
    tasks.reopen("a")
    assert [task.name for task in tasks.ready()] == ["a"]
    assert tasks.lost_base("c") == "a"


def test_a_task_that_nobody_could_do_is_open_again_when_there_is_a_unit_more() -> None:
    tasks = TaskList([_dock("a", None), _dock("b", "a", "a"), Task("c", TaskKind.MOVE)])
    tasks.give_up("c", "its unit has failed")
    tasks.give_up("a", "no unit is left", hopeless=True)
    assert tasks.ended
    tasks.take_up_again()
    assert tasks.names(TaskState.OPEN) == ("a", "b")
    assert tasks.reasons == {"c": "its unit has failed"}
    tasks.give_up("a", "its unit has failed")
    tasks.take_up_again()
    assert tasks.names(TaskState.GIVEN_UP) == ("a", "b", "c")


@pytest.mark.parametrize("order", [("a", "b"), ("b", "a")])
def test_what_depends_on_a_task_given_up_for_good_is_not_taken_up_again(order: tuple[str, str]) -> None:
    """It was open again, and took until it was hopeless once more to be given up."""
    listed = [Task("a", TaskKind.MOVE), Task("b", TaskKind.MOVE), Task("c", TaskKind.MOVE, after=("a", "b"))]
    tasks = TaskList([*listed, Task("d", TaskKind.MOVE, after=("c",))])
    for name in order:
        tasks.give_up(name, "no unit is left" if name == "a" else "seized", hopeless=name == "a")
    tasks.take_up_again()
    assert tasks.names(TaskState.OPEN) == ("a",)
    assert tasks.reasons == {"b": "seized", "c": "needs b", "d": "needs c"}


def test_who_is_on_the_way_to_a_task_given_up_has_lost_it() -> None:
    tasks = TaskList([_dock("a", None), _dock("b", "a", "a"), _dock("c", "b", "b")])
    for name in ("a", "b"):
        tasks.grant(name)
    tasks.reopen("a")
    tasks.give_up("a", "no way")
    assert tasks.names(TaskState.GIVEN_UP) == ("a", "b", "c")
    assert tasks.lost_base("b") == "b"


def test_what_is_done_stays_done_and_only_what_is_open_is_given_up() -> None:
    tasks = TaskList([_dock("done", None), _dock("granted", None), _dock("open", None)])
    for name in ("done", "granted"):
        tasks.grant(name)
    tasks.finish("done")
    for name in ("done", "granted"):
        tasks.give_up(name, "no way")
    for name in ("done", "open"):
        for _ in range(5):
            tasks.fail(name, "seized", in_dock_leg=True)
    tasks.reopen("done")
    assert [tasks.state(name) for name in tasks.by_name] == [
        TaskState.DONE,
        TaskState.GRANTED,
        TaskState.OPEN,
    ]
    assert tasks.reasons == {}


def test_pairs_and_radio_as_a_scene_writes_them() -> None:
    pair = AssembledPair.model_validate("a.front-b.rear")
    assert (pair.active, pair.passive) == ("a.front", "b.rear")
    for wrong in ("a.front", "a.front-a.rear", "a.front-b"):
        with pytest.raises(ValueError, match=r"expected|itself|pattern"):
            AssembledPair.model_validate(wrong)
    with pytest.raises(ValueError, match="until_s"):
        RadioSpec.model_validate({"silences": [{"from_s": 3.0, "until_s": 2.0}]})
