"""Making way: who leaves where it stands, so that a route comes of it for another one."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from msrr_control.coordination.assigner import Assigner
from msrr_control.coordination.interlock import Interlock
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.route_grants import RouteGrants
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.target_place import later_ones_fit, place_of_target
from msrr_control.coordination.task_ends import TaskEnds
from msrr_control.coordination.task_list import TaskList
from msrr_control.coordination.waiting_places import waiting_places
from msrr_control.shapes.tasks import Task, TaskKind, TaskState
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitState

#: Number of waiting places that are tried.
_WAITING_PLACES = 4

#: How often a unit may be sent out of the way before another task is done.
_EVASIONS = 3


class WayMaker:
    """Sends units out of the way, and targets to where their ports can be reached."""

    def __init__(
        self,
        setup: CoordinationSetup,
        units: Mapping[str, UnitRecord],
        interlock: Interlock,
        assigner: Assigner,
        ends: TaskEnds,
        routes: RouteGrants,
    ) -> None:
        """Bind to the ledger, whose records are changed."""
        self._setup, self._units, self._interlock = setup, units, interlock
        self._assigner, self._ends, self._routes = assigner, ends, routes

    def make_way(self, tasks: TaskList, now_ns: int) -> bool:
        """Send one unit out of the way of the first task that has no route; return whether one goes.

        It is idle, or is to leave its port anyway. One that stands in nobody's lane is sent away only where a
        route may come of it: for the task, or for its target if that has to go elsewhere first. Last comes
        the unit of the task itself, if it has a route from elsewhere.
        """
        for task in tasks.ready():
            assigned = self._assigner.assignment(tasks).get(task.name)
            if assigned is None or self._units[assigned].X_WU is None:
                continue  # there is nobody to make way for, or nobody knows where
            lanes = self._ends.lanes_of(task, tasks, assigned)
            if not lanes:
                continue
            idle = [unit for unit in self._assigner.idle() if unit.evasions < _EVASIONS]
            if task.kind is not TaskKind.MOVE and any(self._ends.stays_closed(X_WE) for X_WE in lanes):
                continue
            own, enters = self._units[assigned], self._ends.port_of(task)
            taken_by = None if enters is None else self._ends.taken_by(enters)
            partners = (assigned, None if enters is None else enters[0])
            leaving = [unit for unit in self._units.values() if self._leaves_anyway(unit, tasks)]
            in_the_way = [
                unit
                for unit in idle + leaving
                if unit.name not in partners
                and any(self._setup.lanes.closed_by(X_WE, unit.pose) for X_WE in lanes)
                and taken_by in (None, unit.name)
            ]
            if any(self._evade(unit, tasks, now_ns) for unit in in_the_way):
                return True
            if taken_by is not None:
                continue
            target = None if enters is None else self._units[enters[0]]
            rest = [unit for unit in idle if unit not in in_the_way and unit.name not in partners]
            if self._let_pass(own, task, lanes[0], rest, tasks, now_ns):
                return True
            X_WR = None if target is None else self._place_elsewhere(target, tasks)
            if target is not None and X_WR is not None:
                carried = [unit for unit in leaving if unit.holder and unit.holder[0] == target.name]
                if any(self._evade(unit, tasks, now_ns) for unit in carried):
                    return True
                there = Task(f"place {target.name}", TaskKind.MOVE, target.name, pose=X_WR)
                around = [unit for unit in idle if unit is not target]
                if self._let_pass(target, there, target.pose, around, tasks, now_ns):
                    return True
            # One that a plan sends off leaves its port for that: what is in its way may be the unit that
            # carries it, which cannot drive before.
            sent_off = own.state is UnitState.DOCKED and task.unit is not None and not task.stays
            may_go = own in idle or (
                sent_off and own.evasions < _EVASIONS and not self._routes.waits_for_tracks
            )
            if may_go and self._evade(own, tasks, now_ns, task):
                return True
        return False

    def moves_target(self, target: UnitRecord, tasks: TaskList, now_ns: int) -> bool:
        """Send a unit that stands free to where its ports can be reached; return whether it goes."""
        X_WR = self._place_elsewhere(target, tasks)
        if X_WR is None or not self._routes.grant(target, X_WR, None, now_ns):
            return False
        target.task, target.evasions = None, target.evasions + 1
        target.reason = "goes where its ports can be reached"
        return True

    def sends_back(self, tasks: TaskList) -> bool:
        """Open the last moves again of units that made way for others since; return whether there are any.

        One that carries others stays: it was sent to where its ports can be reached.
        """
        last = {task.unit: task for task in tasks.by_name.values() if task.unit is not None}
        for name, task in last.items():
            unit = self._units[str(name)]
            went_off = unit.state is UnitState.IDLE and unit.task is None and not self._ends.carried_by(unit)
            if task.kind is not TaskKind.MOVE or task.pose is None or not went_off:
                continue
            if not self._setup.tolerance.doubled().holds(task.pose.inverse() @ unit.pose):
                tasks.undo(task.name)
        return bool(tasks.open)

    def keeps_target(self, target: UnitRecord, tasks: TaskList) -> bool:
        """Return whether a unit has to go elsewhere before others dock to it, and carries some until then."""
        return bool(self._ends.carried_by(target)) and self._place_elsewhere(target, tasks) is not None

    def is_awaited_elsewhere(self, target: UnitRecord) -> bool:
        """Return whether a unit was stopped before it came to where others are on the way to its ports."""
        led = [u for u in self._units.values() if u.under_way and u.enters and u.enters[0] == target.name]
        return not target.under_way and not all(self._interlock.holds(target, unit) for unit in led)

    def _leaves_anyway(self, unit: UnitRecord, tasks: TaskList) -> bool:
        """Return whether a docked unit is to leave its port and cannot, though nobody is under way.

        It may wait for what waits for it: for a port whose unit waits for its own port.
        """
        idles = unit.state is UnitState.DOCKED and unit.evasions < _EVASIONS
        if not idles or any(other.under_way for other in self._units.values()):
            return False
        return _is_to_leave(unit, tasks)

    def _let_pass(
        self, unit: UnitRecord, task: Task, X_WB: SE2, others: list[UnitRecord], tasks: TaskList, now_ns: int
    ) -> bool:
        """Send one of some others away if a unit may reach the end of a task then; return whether one goes.

        First comes the nearest to ``X_WB`` without which it does; if there is none, the nearest, because it
        may take several.
        """
        if not others or not self._routes.reaches(unit, task, tasks):
            return False
        others.sort(key=lambda u: math.hypot(u.pose.x - X_WB.x, u.pose.y - X_WB.y))
        alone = next((u for u in others if self._routes.reaches(unit, task, tasks, u)), None)
        others.sort(key=lambda u: u is not alone)
        return any(self._evade(other, tasks, now_ns) for other in others)

    def _place_elsewhere(self, target: UnitRecord, tasks: TaskList) -> SE2 | None:
        """Return where a unit that stands free has to stand, so that its ports can be reached.

        It has to go there before the first unit docks to it, when those have left that it carries. None if it
        cannot, or need not.
        """
        docks = [t for t in tasks.open if t.parent_unit == target.name]
        carried = [self._units[name] for name in self._ends.carried_by(target)]
        idle = target in self._assigner.idle() and target.evasions < _EVASIONS
        if not idle or not all(_is_to_leave(unit, tasks) for unit in carried):
            return None
        there = tasks.open, self._units, self._setup, self._ends.obstacles
        reach = all(t.unit is None or self._routes.reaches(self._units[t.unit], t, tasks) for t in docks)
        return None if reach and later_ones_fit(target, *there) else place_of_target(target, *there)

    def _evade(self, unit: UnitRecord, tasks: TaskList, now_ns: int, task: Task | None = None) -> bool:
        """Send a unit to a waiting place; return whether it goes.

        From there it has to reach the end of ``task``, if there is one, once others drive away.
        """
        assigned = self._assigner.assignment(tasks)
        open_poses = [
            X for task in tasks.open for X in self._ends.lanes_of(task, tasks, assigned.get(task.name))
        ]
        # The unit is among them: it is to go elsewhere.
        seen = [u for u in self._units.values() if u.X_WU is not None]
        places = waiting_places(
            self._setup.lanes, self._setup.finder.inner, open_poses, seen, self._ends.obstacles
        )
        distance = np.hypot(places[:, 0] - unit.pose.x, places[:, 1] - unit.pose.y)
        for x, y in places[np.argsort(distance, kind="stable")[:_WAITING_PLACES]].tolist():
            yaw = math.atan2(y - unit.pose.y, x - unit.pose.x)
            X_WE = SE2(x, y, yaw)
            if task is not None and not self._routes.reaches(unit, task, tasks, X_WU=X_WE):
                continue
            if self._routes.grant(unit, X_WE, None, now_ns):
                unit.task, unit.evasions = None, unit.evasions + 1
                unit.reason = "makes way"
                return True
        return False


def _is_to_leave(unit: UnitRecord, tasks: TaskList) -> bool:
    """Return whether the next task of a docked unit can begin by now, as far as ``after`` says."""
    own = next((task for task in tasks.open if task.unit == unit.name), None)
    return own is not None and all(tasks.state(name) is TaskState.DONE for name in own.after)
