"""The dispatcher: which open task is begun, and by whom."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from msrr_control.coordination.assigner import Assigner
from msrr_control.coordination.interlock import Interlock
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.route_grants import RouteGrants
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.task_ends import TaskEnds
from msrr_control.coordination.task_list import TaskList
from msrr_control.coordination.way_maker import WayMaker
from msrr_control.shapes.tasks import Task, TaskKind
from msrr_scenes.messages.coordination import UnitState

#: Number of other units that are tried when the assigned one finds no route.
_SWAPS = 2


class Dispatcher:
    """Grants routes for open tasks."""

    def __init__(
        self,
        setup: CoordinationSetup,
        units: Mapping[str, UnitRecord],
        interlock: Interlock,
        one_by_one: bool,
    ) -> None:
        """Bind the dispatcher to the ledger, whose records it changes."""
        self._setup, self._units, self._one_by_one = setup, units, one_by_one
        self.ends = TaskEnds(setup, units)
        self.assigner = Assigner(setup, units, self.ends)
        self._routes = RouteGrants(setup, units, interlock, self.ends)
        self._way_maker = WayMaker(setup, units, interlock, self.assigner, self.ends, self._routes)

    def dispatch(self, tasks: TaskList, now_ns: int) -> bool:
        """Grant all that can be granted now; return whether anything was."""
        granted = self._routes.waits_for_tracks = False
        while self._may_grant and self._grant_one(tasks, now_ns):
            granted = True
        if granted or not self._may_grant:
            return granted
        evading = any(unit.under_way and unit.task is None for unit in self._units.values())
        return not evading and self._way_maker.make_way(tasks, now_ns)

    def sends_back(self, tasks: TaskList) -> bool:
        """Open the last moves again of units that made way for others since; return whether there are any."""
        return self._way_maker.sends_back(tasks)

    @property
    def waits_for_tracks(self) -> bool:
        """Whether somebody got no route because another one passes by where it stands."""
        return self._routes.waits_for_tracks

    @property
    def _may_grant(self) -> bool:
        """Whether another unit may get under way."""
        return not (self._one_by_one and any(unit.under_way for unit in self._units.values()))

    def _grant_one(self, tasks: TaskList, now_ns: int) -> bool:
        """Grant one task: to the unit that the assignment names, else to another one that has a route."""
        ready = tasks.ready()
        assigned = self.assigner.assignment(tasks)
        for task in ready:
            name = assigned.get(task.name)
            if name is not None and self._try(task, self._units[name], tasks, now_ns):
                return True
        for task in ready:
            if task.unit is None and task.name in assigned:
                others = [unit for unit in self.assigner.idle() if unit.name != assigned[task.name]]
                costs = self.assigner.costs(others, [task], tasks)[:, 0] if others else np.zeros(0)
                for k in np.argsort(costs, kind="stable")[:_SWAPS].tolist():
                    if self._try(task, others[k], tasks, now_ns):
                        return True
        return False

    def _try(self, task: Task, unit: UnitRecord, tasks: TaskList, now_ns: int) -> bool:
        """Grant a task to a unit if it has a route; return whether it has."""
        if unit.state not in (UnitState.IDLE, UnitState.DOCKED):
            return False
        X_WE, enters = self.ends.pose_of(task, tasks), self.ends.port_of(task)
        if task.kind is TaskKind.DOCK and (X_WE is None or enters is None):
            return False  # nobody knows where its port is
        if enters is not None:
            target = self._units[enters[0]]
            if self._way_maker.is_awaited_elsewhere(target):
                return False  # it may go there once more when nobody is on the way to it
            if self._way_maker.keeps_target(target, tasks):
                return False
            if self._way_maker.moves_target(target, tasks, now_ns):
                return True
        if not self._routes.grant(unit, X_WE, enters, now_ns):
            return False
        unit.task = task.name
        tasks.grant(task.name)
        return True

    def hindrance(self, task: Task, tasks: TaskList) -> str:
        """Return in words why nobody gets a route for an open task."""
        name = self.assigner.assignment(tasks).get(task.name) or next(
            (unit.name for unit in self.assigner.idle()), None
        )
        if name is None:
            unseen = [u.name for u in self._units.values() if u.X_WU is None and not u.out_of_action]
            return "no unit is left" + (f"; never seen from above: {', '.join(unseen)}" if unseen else "")
        unit, enters = self._units[name], self.ends.port_of(task)
        X_WE = self.ends.pose_of(task, tasks)
        reason = self.ends.hindrance(unit, X_WE, enters)
        if reason is None:
            reason = self._setup.finder.obstruction(self._routes.request(unit, X_WE, enters))
        return f"{name} {reason or 'finds no route'}"

    def ahead_in_lane(self, unit: UnitRecord) -> str | None:
        """Return the obstacle that a unit under way would meet in the lane of its port, None without one."""
        if not unit.under_way or unit.track is None or unit.enters is None:
            return None
        return self._setup.finder.ahead_in_lane(unit.track, unit.progress, self.ends.obstacles)
