"""Where tasks end: their poses and ports, who has them, and who stands in the lanes there."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.task_list import TaskList
from msrr_control.shapes.tasks import Task, TaskKind, TaskState
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import UnitState


class TaskEnds:
    """Reads the ends of tasks from the ledger, which changes while units drive, and from seen obstacles."""

    def __init__(self, setup: CoordinationSetup, units: Mapping[str, UnitRecord]) -> None:
        """Bind to the lanes and to the ledger."""
        self._lanes, self._units = setup.lanes, units
        self.obstacles: tuple[ObstacleEstimate, ...] = ()

    def pose_of(self, task: Task, tasks: TaskList) -> SE2 | None:
        """Return where the unit of a task ends; None where it only leaves a port or its parent is unknown."""
        if task.kind is TaskKind.MOVE:
            return task.pose
        if task.kind is TaskKind.UNDOCK:
            return None
        body = self._lanes.body
        if task.parent_unit is not None:
            parent = self._units[task.parent_unit]
            return None if parent.X_WU is None else body.docked(parent.destination, task.port)
        assert task.parent is not None
        holder = self.unit_of(task.parent)
        if holder is not None and tasks.state(task.parent) is TaskState.DONE and holder.X_WU is not None:
            return body.docked(holder.pose, task.port)
        base = self.pose_of(tasks.by_name[task.parent], tasks)
        return None if base is None else body.docked(base, task.port)

    def unit_of(self, task: str) -> UnitRecord | None:
        """Return the unit that has a task or has done it."""
        for unit in self._units.values():
            if unit.task == task and unit.state in (UnitState.UNDER_WAY, UnitState.DOCKED):
                return unit
        return None

    def port_of(self, task: Task) -> tuple[str, str] | None:
        """Return unit and port that a task docks to; None if it does not dock, or the unit is not known."""
        if task.parent is None:
            return None if task.parent_unit is None else (task.parent_unit, task.port)
        holder = self.unit_of(task.parent)
        return None if holder is None else (holder.name, task.port)

    def closing(self, X_WE: SE2, unit: str, port: tuple[str, str]) -> list[str]:
        """Return who stands or will stand in the lane of the pose ``X_WE`` of a unit docked to a port."""
        others = [u for u in self._units.values() if u.X_WU is not None and u.name not in (unit, port[0])]
        rests = [(other.name, X.as_array()) for other in others for X in other.resting_places]
        closes = self._lanes.closes(X_WE, np.array([X for _, X in rests]).reshape(-1, 3))
        return list(dict.fromkeys(name for (name, _), does in zip(rests, closes, strict=True) if does))

    def stays_closed(self, X_WE: SE2) -> bool:
        """Return whether an obstacle, or a unit out of action, stands in the lane of a docked pose."""
        if self._lanes.obstacle_in(X_WE, self.obstacles) is not None:
            return True
        out = [u for u in self._units.values() if u.out_of_action and u.X_WU is not None]
        return any(self._lanes.closed_by(X_WE, X_WB) for unit in out for X_WB in unit.resting_places)

    def lanes_of(self, task: Task, tasks: TaskList, assigned: str | None) -> list[SE2]:
        """Return the poses whose lanes a task needs: that of its end, and that of a port which is left."""
        X_WE = self.pose_of(task, tasks)
        unit = None if assigned is None else self._units[assigned]
        leaves = unit is not None and unit.holder is not None and unit.X_WU is not None
        return [*([] if X_WE is None else [X_WE]), *([unit.pose] if unit is not None and leaves else [])]

    def carried_by(self, unit: UnitRecord) -> list[str]:
        """Return the units that stay docked to a unit, so that it cannot drive."""
        return [
            other.name
            for other in self._units.values()
            if not other.under_way and any(holder == unit.name for holder, _ in other.docks)
        ]

    def taken_by(self, enters: tuple[str, str]) -> str | None:
        """Return the unit that is, may be or will be in a port; None if there is none."""
        return next((unit.name for unit in self._units.values() if enters in unit.docks), None)

    def hindrance(self, unit: UnitRecord, X_WE: SE2 | None, enters: tuple[str, str] | None) -> str | None:
        """Return what keeps a unit from a route before one is looked for, in words; None if nothing does.

        ``X_WE``, where the unit is to end, is None where it only leaves a port, and ``enters``, the unit and
        port at which it is to end, is None in the open.
        """
        if unit.out_of_action:
            return f"{'is lost' if unit.state is UnitState.LOST else 'has failed'}: {unit.reason}"
        if unit.X_WU is None:
            return "was never seen from above"
        if carried := self.carried_by(unit):
            return f"carries {', '.join(carried)}, and only a unit that carries no other one drives"
        if enters is None:
            return None
        if self._units[enters[0]].out_of_action:
            how = "has failed" if self._units[enters[0]].state is UnitState.FAILED else "is lost"
            return f"cannot dock: {enters[0]} {how}"  # nobody is allowed into its port
        if self._units[enters[0]].X_WU is None:
            return f"cannot dock: {enters[0]} was never seen from above"
        port, taken_by = ".".join(enters), self.taken_by(enters)
        if taken_by not in (None, unit.name):
            return f"cannot dock: {port} is taken by {taken_by}"
        closing = [] if X_WE is None else self.closing(X_WE, unit.name, enters)
        close = "close" if len(closing) > 1 else "closes"
        return f"cannot dock: {', '.join(closing)} {close} the lane to {port}" if closing else None
