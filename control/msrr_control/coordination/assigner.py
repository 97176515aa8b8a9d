"""The assignment of units to the open tasks of a mission."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from msrr_control.coordination.embedding import assign, place_costs
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.task_ends import TaskEnds
from msrr_control.coordination.task_list import TaskList
from msrr_control.shapes.tasks import Task
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitState

#: Time by which a way counts as longer for each time that the unit has missed the end of the task [s]: what
#: misleads it there may mislead it again, and another unit takes that place if there is one.
_MISSED_S = 20.0


class Assigner:
    """Assigns units to tasks by the estimated times of their ways.

    Attributes:
        wanted: Unit of each task by the choice of where the shape is built; it holds while all are idle.
    """

    def __init__(self, setup: CoordinationSetup, units: Mapping[str, UnitRecord], ends: TaskEnds) -> None:
        """Bind to the ledger, and to the ends of tasks."""
        self._travel, self._units, self._ends = setup.travel, units, ends
        self.wanted: dict[str, str] = {}

    def idle(self) -> list[UnitRecord]:
        """Return the units that may take any task: they stand free and have been seen."""
        return [
            unit
            for unit in self._units.values()
            if unit.state is UnitState.IDLE and unit.X_WU is not None and unit.holder is None
        ]

    def assignment(self, tasks: TaskList) -> dict[str, str]:
        """Return the unit for each open task, as far as there are units.

        The first tasks come first, but last of all those that nobody can begin now.
        """
        result = {task.name: task.unit for task in tasks.open if task.unit is not None}
        reserved = set(result.values())
        idle = [unit for unit in self.idle() if unit.name not in reserved]
        free = [task for task in tasks.open if task.unit is None]
        if 0 < len(idle) < len(free):
            closed = self._closed(free, tasks)
            free.sort(key=lambda task: task.name in closed)
        free = free[: len(idle)]
        names = {unit.name for unit in idle}
        wanted = {task.name: self.wanted.get(task.name) for task in free}
        if all(unit in names and not tasks.misses(task, str(unit)) for task, unit in wanted.items()):
            return result | {task: str(unit) for task, unit in wanted.items()}
        costs = self.costs(idle, free, tasks)
        pairs, _ = assign(costs)
        return result | {free[p].name: idle[u].name for u, p in pairs}

    def _closed(self, free: list[Task], tasks: TaskList) -> set[str]:
        """Return the names of the tasks that nobody can begin now.

        Their port is taken, something stays in the lane of it, or such a task comes before them.
        """
        closed: set[str] = set()
        for task in free:  # parents come before their children
            enters, X_WE = self._ends.port_of(task), self._ends.pose_of(task, tasks)
            taken = enters is not None and self._ends.taken_by(enters) is not None
            blocked = X_WE is not None and self._ends.stays_closed(X_WE)
            if taken or blocked or not closed.isdisjoint((*task.depends_on, *task.behind)):
                closed.add(task.name)
        return closed

    def costs(self, units: list[UnitRecord], free: list[Task], tasks: TaskList) -> Array:
        """Return the estimated times of the ways of units to the ends of some tasks, (units, tasks) [s]."""
        poses = [self._ends.pose_of(task, tasks) or SE2() for task in free]
        places = np.array([X.as_array() for X in poses])
        misses = np.array([[tasks.misses(task.name, unit.name) for task in free] for unit in units])
        ways = place_costs(np.array([unit.pose.as_array() for unit in units]), places, self._travel)
        return ways + _MISSED_S * misses
