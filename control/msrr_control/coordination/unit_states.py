"""The states of all units: who has arrived, who has failed, who is lost and who was found again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.task_list import TaskList
from msrr_control.coordination.watch import Watch
from msrr_control.shapes.tasks import TaskKind, TaskState
from msrr_scenes.messages.coordination import UnitMode, UnitState


class Changes(NamedTuple):
    """Whether any unit counts as something else since the last step.

    ``missed`` is the number of units that did not end where they should, so that routes are planned anew.
    """

    any: bool
    missed: int


class UnitStates:
    """Keeps the states of the units under way and of those that are lost, and those of their tasks."""

    def __init__(self, units: Mapping[str, UnitRecord], watch: Watch) -> None:
        """Bind to the ledger, whose records are changed, and to what judges the progress in it."""
        self._units, self._watch = units, watch

    def update(self, tasks: TaskList, now_ns: int) -> Changes:
        """Note what units have reported, and what was seen of them."""
        changed, missed = False, 0
        for unit in self._units.values():
            report = unit.report
            if unit.state is UnitState.FAILED:
                continue
            if report is not None and report.mode is UnitMode.FAILED:
                _fail(unit, report.reason or "reports a failure", tasks, now_ns)
            elif unit.state is UnitState.LOST and self._watch.is_found(unit):
                _find(unit, tasks, now_ns)
            elif unit.state is UnitState.LOST and self._watch.stopped_short(unit):
                unit.enters = None  # its port is free for others
                tasks.take_up_again()
            elif not unit.under_way:
                continue
            elif unit.says_lost:
                _lose(unit, "" if report is None else report.reason, tasks, now_ns)
            elif self._watch.has_arrived(unit, now_ns):
                missed += not self._arrive(unit, tasks, now_ns)
            elif (silence := self._watch.silence(unit, now_ns)) is not None:
                _lose(unit, silence, tasks, now_ns)
            elif (stagnation := self._watch.stagnation(unit, now_ns)) is not None:
                _fail(unit, stagnation, tasks, now_ns)
            else:
                continue
            changed = True
        return Changes(changed, missed)

    def _arrive(self, unit: UnitRecord, tasks: TaskList, now_ns: int) -> bool:
        """Note that a unit has driven its route to the end; return whether it stands where it should."""
        self._watch.restart(now_ns)
        task = None if unit.task is None else tasks.by_name[unit.task]
        if task is None or tasks.state(task.name) is not TaskState.GRANTED:
            unit.stand(now_ns, unit.reason)
        elif task.kind is TaskKind.MOVE and not self._watch.is_at_end(unit):
            tasks.miss(task.name, unit.name)
            unit.stand(now_ns, "did not end where it should")
            return False
        elif task.kind is TaskKind.UNDOCK and self._watch.has_not_left(unit):
            _fail(unit, "says that it has left its port, and is seen there", tasks, now_ns)
        else:
            tasks.finish(task.name)
            stays = task.stays or task.kind is TaskKind.DOCK
            unit.stand(now_ns, "", UnitState.DOCKED if stays else UnitState.IDLE)
        return True


def _lose(unit: UnitRecord, reason: str, tasks: TaskList, now_ns: int) -> None:
    """Note that nobody knows what a unit does; its task is open for another one until it is found."""
    if unit.task is not None:
        tasks.reopen(unit.task)
    unit.stand(now_ns, reason, UnitState.LOST)


def _find(unit: UnitRecord, tasks: TaskList, now_ns: int) -> None:
    """Take up a unit that was lost: it has docked where it was to dock, or stands and is free."""
    tasks.take_up_again()
    docked = unit.holder is not None and unit.holder == unit.enters
    if docked and unit.task is not None and tasks.state(unit.task) is TaskState.OPEN:
        tasks.finish(unit.task)
    unit.stand(now_ns, "" if docked else "was lost and is found again")
    if unit.holder is None:
        unit.stand_down()
    elif not docked:
        unit.track = None  # its authority must not be renewed: the route begins with leaving the port


def _fail(unit: UnitRecord, reason: str, tasks: TaskList, now_ns: int) -> None:
    """Note that a unit has failed; its task is open for another one."""
    if unit.task is not None and unit.under_way:  # a task that it had before may be another one's by now
        tasks.fail(unit.task, f"{unit.name} failed: {reason}", unit.in_dock_leg)
    unit.stand(now_ns, reason, UnitState.FAILED)
