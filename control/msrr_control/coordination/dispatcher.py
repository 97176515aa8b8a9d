"""The dispatcher: which open task is begun, on which route, and who makes way for whom."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from msrr_control.coordination.assemblies import standing_unit
from msrr_control.coordination.assigner import Assigner
from msrr_control.coordination.interlock import Interlock, clear_of_tracks
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.target_place import later_ones_fit, place_of_target
from msrr_control.coordination.task_ends import TaskEnds
from msrr_control.coordination.task_list import TaskList
from msrr_control.coordination.waiting_places import waiting_places
from msrr_control.shapes.tasks import Task, TaskKind
from msrr_control.tracks.route_request import RouteRequest
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitState

#: Number of other units that are tried when the assigned one finds no route, and of waiting places.
_SWAPS, _WAITING_PLACES = 2, 4

#: How often a unit may be sent out of the way.
_EVASIONS = 3


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
        self._setup, self._units, self._interlock = setup, units, interlock
        self._one_by_one = one_by_one
        self.ends = TaskEnds(setup, units)
        self.assigner = Assigner(setup, units, self.ends)
        self._order = 0
        self.waits_for_tracks = False  # whether somebody got no route because another one passes by

    def dispatch(self, tasks: TaskList, now_ns: int) -> bool:
        """Grant all that can be granted now; return whether anything was."""
        granted = self.waits_for_tracks = False
        while self._may_grant and self._grant_one(tasks, now_ns):
            granted = True
        if granted or not self._may_grant:
            return granted
        evading = any(unit.under_way and unit.task is None for unit in self._units.values())
        return not evading and self._make_way(tasks, now_ns)

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
            if self._is_awaited_elsewhere(target):
                return False  # it may go there once more when nobody is on the way to it
            if self._moves_target(target, tasks, now_ns):
                return True
        if not self._grant(unit, X_WE, enters, now_ns):
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
            reason = self._setup.finder.obstruction(self._request(unit, X_WE, enters))
        return f"{name} {reason or 'finds no route'}"

    def ahead_in_lane(self, unit: UnitRecord) -> str | None:
        """Return the obstacle that a unit under way would meet in the lane of its port, None without one."""
        if not unit.under_way or unit.track is None or unit.enters is None:
            return None
        return self._setup.finder.ahead_in_lane(unit.track, unit.progress, self.ends.obstacles)

    def _grant(self, unit: UnitRecord, X_WE: SE2 | None, enters: tuple[str, str] | None, now_ns: int) -> bool:
        """Give a unit a route of its own; return whether there is one."""
        if self.ends.hindrance(unit, X_WE, enters) is not None:
            return False
        if not clear_of_tracks(unit.pose, unit, self._units.values(), self._setup.lanes.body):
            self.waits_for_tracks = True
            return False
        track = self._setup.finder.find(self._request(unit, X_WE, enters))
        if track is None:
            return False
        self._order += 1
        self._interlock.forget(unit.name)
        unit.set_out(track, enters, self._order, now_ns)
        return True

    def _request(self, unit: UnitRecord, X_WE: SE2 | None, enters: tuple[str, str] | None) -> RouteRequest:
        """Return what a route has to be for a unit that is to end at a pose, or to leave its port."""
        units = self._units.values()
        others = [u for u in units if u.name != unit.name and u.X_WU is not None]
        return RouteRequest(
            unit.pose,
            X_WE,
            [standing_unit(other, units) for other in others],
            self.ends.obstacles,
            dock=enters is not None,
            leaves=None if unit.holder is None else unit.holder[0],
            enters=None if enters is None else enters[0],
            held=unit.held,
        )

    # Making way.

    def _make_way(self, tasks: TaskList, now_ns: int) -> bool:
        """Send one idle unit out of the way of the first task that has no route; return whether one goes.

        One that stands in nobody's lane is sent away only where a route may come of it: for the task, or for
        its target if that has to go elsewhere first. Last comes the unit of the task itself, if it has a
        route from elsewhere.
        """
        for task in tasks.ready():
            assigned = self.assigner.assignment(tasks).get(task.name)
            if assigned is None or self._units[assigned].X_WU is None:
                continue  # there is nobody to make way for, or nobody knows where
            lanes = self.ends.lanes_of(task, tasks, assigned)
            if not lanes:
                continue
            idle = [unit for unit in self.assigner.idle() if unit.evasions < _EVASIONS]
            if task.kind is not TaskKind.MOVE and any(self.ends.stays_closed(X_WE) for X_WE in lanes):
                continue
            enters = self.ends.port_of(task)
            if enters is not None and self.ends.taken_by(enters) is not None:
                continue
            partners = (assigned, None if enters is None else enters[0])
            in_the_way = [
                unit
                for unit in idle
                if unit.name not in partners
                and any(self._setup.lanes.closed_by(X_WE, unit.pose) for X_WE in lanes)
            ]
            if any(self._evade(unit, tasks, now_ns) for unit in in_the_way):
                return True
            own, target = self._units[assigned], None if enters is None else self._units[enters[0]]
            rest = [unit for unit in idle if unit not in in_the_way and unit.name not in partners]
            if self._let_pass(own, task, lanes[0], rest, tasks, now_ns):
                return True
            X_WR = None if target is None else self._place_elsewhere(target, tasks)
            if target is not None and X_WR is not None:
                there = Task(f"place {target.name}", TaskKind.MOVE, target.name, pose=X_WR)
                around = [unit for unit in idle if unit is not target]
                if self._let_pass(target, there, target.pose, around, tasks, now_ns):
                    return True
            # One that a plan sends off leaves its port for that: what is in its way may be the unit that
            # carries it, which cannot drive before.
            leaves = own.state is UnitState.DOCKED and task.unit is not None and not task.stays
            may_go = own in idle or (leaves and own.evasions < _EVASIONS and not self.waits_for_tracks)
            if may_go and self._evade(own, tasks, now_ns, task):
                return True
        return False

    def _let_pass(
        self, unit: UnitRecord, task: Task, X_WB: SE2, others: list[UnitRecord], tasks: TaskList, now_ns: int
    ) -> bool:
        """Send one of some others away if a unit may reach the end of a task then; return whether one goes.

        First comes the nearest to ``X_WB`` without which it does; if there is none, the nearest, because it
        may take several.
        """
        if not others or not self._reaches(unit, task, tasks):
            return False
        others.sort(key=lambda u: math.hypot(u.pose.x - X_WB.x, u.pose.y - X_WB.y))
        alone = next((u for u in others if self._reaches(unit, task, tasks, u)), None)
        others.sort(key=lambda u: u is not alone)
        return any(self._evade(other, tasks, now_ns) for other in others)

    def _place_elsewhere(self, target: UnitRecord, tasks: TaskList) -> SE2 | None:
        """Return where a unit that stands free has to stand, so that its ports can be reached.

        It has to go there before the first unit docks to it. None if it cannot, or need not.
        """
        docks = [t for t in tasks.open if t.parent_unit == target.name]
        carries = any(target.name == port[0] for unit in self._units.values() for port in unit.docks)
        idle = target in self.assigner.idle() and target.evasions < _EVASIONS
        if carries or not idle:
            return None
        there = tasks.open, self._units, self._setup, self.ends.obstacles
        reach = all(t.unit is None or self._reaches(self._units[t.unit], t, tasks) for t in docks)
        return None if reach and later_ones_fit(target, *there) else place_of_target(target, *there)

    def _moves_target(self, target: UnitRecord, tasks: TaskList, now_ns: int) -> bool:
        """Send a unit that stands free to where its ports can be reached; return whether it goes."""
        X_WR = self._place_elsewhere(target, tasks)
        if X_WR is None or not self._grant(target, X_WR, None, now_ns):
            return False
        target.task, target.evasions = None, target.evasions + 1
        target.reason = "goes where its ports can be reached"
        return True

    def _is_awaited_elsewhere(self, target: UnitRecord) -> bool:
        """Return whether a unit was stopped before it came to where others are on the way to its ports."""
        led = [u for u in self._units.values() if u.under_way and u.enters and u.enters[0] == target.name]
        return not target.under_way and not all(self._interlock.holds(target, unit) for unit in led)

    def _reaches(
        self,
        unit: UnitRecord,
        task: Task,
        tasks: TaskList,
        gone: UnitRecord | None = None,
        X_WU: SE2 | None = None,
    ) -> bool:
        """Return whether a unit would reach the end of a task if another one was gone.

        Args:
            unit: The unit.
            task: The task.
            tasks: All tasks.
            gone: The other one; None for all others that can drive away.
            X_WU: Where the unit sets out in the open; None for where it stands.
        """
        X_WE, enters = self.ends.pose_of(task, tasks), self.ends.port_of(task)
        if X_WE is None or unit.X_WU is None:
            return True  # nobody knows
        request = self._request(unit, X_WE, enters)
        if X_WU is not None:
            request = replace(request, X_WU=X_WU, leaves=None)
        docked = [other for other in self._units.values() if X_WU is None or other is not unit]
        holders = {port[0] for other in docked for port in other.docks}
        away = {
            other.name
            for other in (self._units.values() if gone is None else (gone,))
            if not (other.docks or other.name in holders or other.out_of_action)
        }
        away -= {request.leaves, request.enters}
        kept = [s for s in request.standing if s.name not in away]
        return self._setup.finder.find(replace(request, standing=kept)) is not None

    def _evade(self, unit: UnitRecord, tasks: TaskList, now_ns: int, task: Task | None = None) -> bool:
        """Send a unit to a waiting place; return whether it goes.

        Args:
            unit: The unit.
            tasks: All tasks.
            now_ns: Time [ns].
            task: What the unit has to reach from there, if others drive away; None for nothing.
        """
        assigned = self.assigner.assignment(tasks)
        open_poses = [
            X for task in tasks.open for X in self.ends.lanes_of(task, tasks, assigned.get(task.name))
        ]
        # The unit is among them: it is to go elsewhere.
        seen = [u for u in self._units.values() if u.X_WU is not None]
        places = waiting_places(
            self._setup.lanes, self._setup.finder.inner, open_poses, seen, self.ends.obstacles
        )
        distance = np.hypot(places[:, 0] - unit.pose.x, places[:, 1] - unit.pose.y)
        for x, y in places[np.argsort(distance, kind="stable")[:_WAITING_PLACES]].tolist():
            yaw = math.atan2(y - unit.pose.y, x - unit.pose.x)
            X_WE = SE2(x, y, yaw)
            if task is not None and not self._reaches(unit, task, tasks, X_WU=X_WE):
                continue
            if self._grant(unit, X_WE, None, now_ns):
                unit.task, unit.evasions = None, unit.evasions + 1
                unit.reason = "makes way"
                return True
        return False
