"""Tasks that others have taken the place of: what of them is told when the mission ends."""

from __future__ import annotations

from msrr_control.coordination.past_tasks import PastTasks
from msrr_control.coordination.task_list import TaskList
from msrr_control.shapes.tasks import Task, TaskKind


def _hops() -> TaskList:
    tasks = TaskList([Task(f"{unit} hops", TaskKind.DOCK, unit, parent_unit="r") for unit in "abc"])
    for unit in "ab":
        tasks.grant(f"{unit} hops")
    tasks.finish("a hops")
    tasks.fail("b hops", "b failed: seized", in_dock_leg=False)
    return tasks


def _after(hopping: str, out: str, whole: bool) -> PastTasks:
    past = PastTasks()
    past.replace(_hops(), hopping, out, whole, lambda task: f"{task.unit} waits")
    assert past.done == ("a hops",)
    return past


def test_nothing_is_missing_where_others_fill_all_places() -> None:
    assert _after("c", "", whole=True).undone == {}
    assert _after("", "", whole=True).undone == {}


def test_a_unit_that_leaves_its_place_empty_is_told_with_the_reason() -> None:
    """One that hops otherwise is not: it waits for nothing any more."""
    failed, waits = {("b", "b hops"): "b failed: seized"}, {("c", "c hops"): "c waits"}
    assert _after("c", "b", whole=False).undone == failed
    assert _after("", "b", whole=False).undone == failed | waits
    assert _after("c", "b", whole=True).undone == failed, "it counts as missing in a place that it is in"


def test_some_reason_is_told_where_places_stay_empty_for_units_that_hop() -> None:
    assert _after("bc", "", whole=False).undone.keys() == {("b", "b hops"), ("c", "c hops")}


def test_reasons_last_until_their_units_hop() -> None:
    past = _after("c", "b", whole=False)
    past.replace(TaskList(()), (), "b", False, lambda task: "")
    assert past.undone == {("b", "b hops"): "b failed: seized"}
    past.replace(TaskList([Task("b hops", TaskKind.DOCK, "b")]), "b", "", True, lambda task: "")
    assert past.undone == {}
    assert past.done == ("a hops",)
