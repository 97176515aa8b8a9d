"""What becomes of a unit and of its task when it arrives, fails, is lost or is found again."""

from __future__ import annotations

import pytest

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.mission import Patience
from msrr_control.coordination.task_list import TaskList
from msrr_control.coordination.unit_states import Changes, UnitStates
from msrr_control.coordination.watch import Watch
from msrr_control.shapes.tasks import Task, TaskKind, TaskState
from msrr_control.tracks.track import TrackBuilder
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitMode, UnitReport, UnitState

PATIENCE = Patience()
S = 1_000_000_000
NOW_S = 10.0


def _unit(mode: UnitMode, reason: str = "", docked_to: str | None = None) -> UnitRecord:
    """A unit at the end of a way of 0.5 m ahead, of which it tells at 10 s, and which was seen there."""
    builder = TrackBuilder(SE2(), 0.1)
    builder.ahead(0.5)
    unit = UnitRecord("a", builder.pose, state=UnitState.UNDER_WAY, task="t", route=1, track=builder.track())
    unit.limit, unit.seen_ns = builder.track().length, round(NOW_S * S)
    unit.receive(
        UnitReport("a", round(NOW_S * S), 1, 1, builder.track().length, mode, docked_to, reason=reason),
        round(NOW_S * S),
    )
    unit.expired = False
    return unit


def _tasks(kind: TaskKind = TaskKind.MOVE, stays: bool = False) -> TaskList:
    tasks = TaskList([Task("t", kind, stays=stays)])
    tasks.grant("t")
    return tasks


def _update(unit: UnitRecord, tasks: TaskList, now_s: float = NOW_S) -> Changes:
    return UnitStates({"a": unit}, Watch(PATIENCE)).update(tasks, round(now_s * S))


@pytest.mark.parametrize(
    ("kind", "stays", "state"),
    [
        (TaskKind.MOVE, False, UnitState.IDLE),
        (TaskKind.MOVE, True, UnitState.DOCKED),  # the root of a shape
        (TaskKind.UNDOCK, False, UnitState.IDLE),
    ],
)
def test_a_unit_that_arrives_has_done_its_task(kind: TaskKind, stays: bool, state: UnitState) -> None:
    unit, tasks = _unit(UnitMode.STANDING), _tasks(kind, stays)
    assert _update(unit, tasks) == Changes(True, 0)
    assert (unit.state, unit.reason, tasks.state("t")) == (state, "", TaskState.DONE)
    assert _update(unit, tasks) == Changes(False, 0)


def test_a_unit_that_arrives_in_a_port_is_docked() -> None:
    unit, tasks = _unit(UnitMode.DOCKED, docked_to="b.rear"), _tasks(TaskKind.DOCK)
    unit.enters = ("b", "rear")
    assert _update(unit, tasks) == Changes(True, 0)
    assert (unit.state, tasks.state("t")) == (UnitState.DOCKED, TaskState.DONE)


def test_a_unit_that_misses_the_end_of_a_move_has_not_done_it() -> None:
    for kind, missed, state in ((TaskKind.MOVE, 1, TaskState.OPEN), (TaskKind.UNDOCK, 0, TaskState.DONE)):
        unit, tasks = _unit(UnitMode.STANDING), _tasks(kind)
        unit.X_WU = unit.pose @ SE2(0.0, 0.1, 0.0)
        assert _update(unit, tasks, NOW_S + PATIENCE.unseen_s) == Changes(True, missed)
        assert (unit.state, tasks.state("t")) == (UnitState.IDLE, state)
        assert unit.reason == ("did not end where it should" if missed else "")


def test_who_missed_the_end_of_a_task_is_known() -> None:
    unit, tasks = _unit(UnitMode.STANDING), _tasks()
    unit.X_WU = unit.pose @ SE2(0.0, 0.1, 0.0)
    _update(unit, tasks, NOW_S + PATIENCE.unseen_s)
    assert (tasks.misses("t", "a"), tasks.misses("t", "b")) == (1, 0)


@pytest.mark.parametrize(
    ("driven", "seen_s", "state"),
    [
        (0.0, NOW_S, UnitState.FAILED),
        (0.4, NOW_S, UnitState.FAILED),
        (0.6, NOW_S, UnitState.IDLE),
        (0.0, NOW_S - 0.1, UnitState.IDLE),  # nobody saw where it stands
    ],
)
def test_a_unit_that_is_seen_in_the_port_that_it_says_it_has_left_has_failed(
    driven: float, seen_s: float, state: UnitState
) -> None:
    """Its task was done by its word alone."""
    builder = TrackBuilder(SE2(), 0.1)
    builder.back(0.5)
    unit, tasks = _unit(UnitMode.STANDING), _tasks(TaskKind.UNDOCK)
    unit.track, unit.X_WU = builder.track(), SE2(-0.5 * driven, 0.0, 0.0)
    unit.seen_ns = round(seen_s * S)
    assert _update(unit, tasks, NOW_S + PATIENCE.unseen_s) == Changes(True, 0)
    assert unit.state is state
    assert tasks.state("t") is (TaskState.DONE if state is UnitState.IDLE else TaskState.OPEN)


@pytest.mark.parametrize("task", ["t", None])
def test_a_unit_without_a_task_only_stands_where_it_has_come_to(task: str | None) -> None:
    """It makes way, or its task is open again."""
    unit, tasks = _unit(UnitMode.STANDING, "x"), _tasks()
    tasks.reopen("t")
    unit.task, unit.reason = task, "makes way"
    assert _update(unit, tasks) == Changes(True, 0)
    assert (unit.state, unit.reason, tasks.state("t")) == (UnitState.IDLE, "makes way", TaskState.OPEN)


@pytest.mark.parametrize(
    ("mode", "said", "later_s", "state", "reason"),
    [
        (UnitMode.FAILED, "seized", 0.0, UnitState.FAILED, "seized"),
        (UnitMode.FAILED, "", 0.0, UnitState.FAILED, "reports a failure"),
        (UnitMode.LOST, "dark", 0.0, UnitState.LOST, "dark"),
        (UnitMode.DRIVING, "", PATIENCE.unheard_s + 1.0, UnitState.LOST, "not heard for 61 s"),
    ],
)
def test_the_task_of_a_unit_that_fails_or_is_lost_is_open_for_another(
    mode: UnitMode, said: str, later_s: float, state: UnitState, reason: str
) -> None:
    unit, tasks = _unit(mode, said), _tasks()
    assert _update(unit, tasks, NOW_S + later_s) == Changes(True, 0)
    assert (unit.state, unit.reason, tasks.state("t")) == (state, reason, TaskState.OPEN)
    assert _update(unit, tasks, NOW_S + later_s) == Changes(False, 0)
    idler, tasks = _unit(mode, said), _tasks()
    idler.task = None
    assert _update(idler, tasks, NOW_S + later_s) == Changes(True, 0)
    assert (idler.state, tasks.state("t")) == (state, TaskState.GRANTED)


def test_what_happens_to_a_lost_unit_is_nothing_to_the_one_that_has_its_task_by_then() -> None:
    for mode, holder, state in (
        (UnitMode.FAILED, None, UnitState.FAILED),
        (UnitMode.DOCKED, ("b", "rear"), UnitState.DOCKED),
    ):
        unit, tasks = _unit(mode), _tasks(TaskKind.DOCK)
        unit.state, unit.holder, unit.enters = UnitState.LOST, holder, holder
        assert _update(unit, tasks) == Changes(True, 0)
        assert (unit.state, tasks.state("t")) == (state, TaskState.GRANTED)


def test_a_lost_unit_keeps_its_port_until_it_is_seen_to_have_stopped_short_of_it() -> None:
    """What was given up because that port was taken is open again."""
    builder = TrackBuilder(SE2(), 0.1)
    builder.ahead(1.0)
    builder.dock(builder.pose @ SE2(0.7, 0.0, 0.0), 0.7)
    unit, tasks = _unit(UnitMode.DRIVING), _tasks(TaskKind.DOCK)
    unit.track, unit.limit, unit.enters = builder.track(), builder.track().length, ("b", "rear")
    lost_s = NOW_S + PATIENCE.unheard_s + 1.0
    assert _update(unit, tasks, lost_s) == Changes(True, 0)
    tasks.give_up("t", "its port is taken", hopeless=True)
    assert _update(unit, tasks, lost_s + 9.0) == Changes(False, 0)
    assert (unit.state, unit.docks) == (UnitState.LOST, (("b", "rear"),))
    unit.seen_ns = round((lost_s + 9.0) * S)
    assert _update(unit, tasks, lost_s + 9.0) == Changes(True, 0)
    assert (unit.state, unit.docks, tasks.state("t")) == (UnitState.LOST, (), TaskState.OPEN)
    assert _update(unit, tasks, lost_s + 9.0) == Changes(False, 0)


def test_a_unit_that_is_heard_and_makes_no_progress_fails() -> None:
    unit, tasks, late_s = _unit(UnitMode.DRIVING), _tasks(), NOW_S + PATIENCE.lost_s
    unit.heard_ns = round(late_s * S)
    assert _update(unit, tasks, late_s - 0.1) == Changes(False, 0)
    assert _update(unit, tasks, late_s + 0.1) == Changes(True, 0)
    assert (unit.state, tasks.state("t")) == (UnitState.FAILED, TaskState.OPEN)
    assert unit.reason.startswith("no progress beyond 0.50 m")


def test_a_unit_that_fails_when_it_has_arrived_leaves_its_task_done() -> None:
    unit, tasks = _unit(UnitMode.STANDING), _tasks()
    _update(unit, tasks)
    unit.report = UnitReport("a", round(11.0 * S), 1, 1, 0.5, UnitMode.FAILED, None)
    assert _update(unit, tasks, 11.0) == Changes(True, 0)
    assert (unit.state, tasks.state("t")) == (UnitState.FAILED, TaskState.DONE)


@pytest.mark.parametrize(
    ("holder", "enters", "state", "task", "route"),
    [
        (None, None, UnitState.IDLE, TaskState.OPEN, 2),  # it goes on standby
        (("b", "rear"), ("b", "rear"), UnitState.DOCKED, TaskState.DONE, 1),
        (("b", "rear"), ("c", "rear"), UnitState.DOCKED, TaskState.OPEN, 1),  # it has not left its port
    ],
)
def test_a_unit_that_is_found_is_free_or_where_it_was_to_be_or_where_it_was(
    holder: tuple[str, str] | None,
    enters: tuple[str, str] | None,
    state: UnitState,
    task: TaskState,
    route: int,
) -> None:
    for has_task in (True, False):
        unit, tasks = _unit(UnitMode.STANDING), _tasks(TaskKind.DOCK)
        tasks.reopen("t")
        unit.state, unit.holder, unit.enters, unit.still_ns = UnitState.LOST, holder, enters, round(2.0 * S)
        unit.task = "t" if has_task else None
        before = unit.track
        assert _update(unit, tasks) == Changes(True, 0)
        arrived = holder is not None and holder == enters
        assert unit.reason == ("" if arrived else "was lost and is found again")
        assert (unit.state, unit.route) == (state, route)
        assert tasks.state("t") is (task if has_task else TaskState.OPEN)
        if holder is None:
            assert unit.track is not None
            assert unit.track.legs == ()
        else:
            assert unit.track is (before if arrived else None)
