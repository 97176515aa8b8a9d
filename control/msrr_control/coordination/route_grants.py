"""The routes of units: what they are asked for, whether there is one, and who is given one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from msrr_control.coordination.assemblies import standing_bodies
from msrr_control.coordination.interlock import Interlock, clear_of_tracks
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.task_ends import TaskEnds
from msrr_control.coordination.task_list import TaskList
from msrr_control.shapes.tasks import Task
from msrr_control.tracks.route_request import RouteRequest
from msrr_scenes.geometry.se2 import SE2


class RouteGrants:
    """Finds routes for units, and gives them out in an order.

    Attributes:
        waits_for_tracks: Whether somebody got no route because another one passes by where it stands.
    """

    def __init__(
        self,
        setup: CoordinationSetup,
        units: Mapping[str, UnitRecord],
        interlock: Interlock,
        ends: TaskEnds,
    ) -> None:
        """Bind to the ledger, whose records are changed."""
        self._setup, self._units, self._interlock, self._ends = setup, units, interlock, ends
        self._order = 0
        self.waits_for_tracks = False

    def grant(self, unit: UnitRecord, X_WE: SE2 | None, enters: tuple[str, str] | None, now_ns: int) -> bool:
        """Give a unit a route of its own; return whether there is one."""
        if self._ends.hindrance(unit, X_WE, enters) is not None:
            return False
        if not clear_of_tracks(unit.pose, unit, self._units.values(), self._setup.lanes.body):
            self.waits_for_tracks = True
            return False
        track = self._setup.finder.find(self.request(unit, X_WE, enters))
        if track is None:
            return False
        self._order += 1
        self._interlock.forget(unit.name)
        unit.set_out(track, enters, self._order, now_ns)
        return True

    def request(self, unit: UnitRecord, X_WE: SE2 | None, enters: tuple[str, str] | None) -> RouteRequest:
        """Return what a route has to be for a unit that is to end at a pose, or to leave its port."""
        units = self._units.values()
        others = [u for u in units if u.name != unit.name and u.X_WU is not None]
        return RouteRequest(
            unit.pose,
            X_WE,
            [body for other in others for body in standing_bodies(other, units)],
            self._ends.obstacles,
            dock=enters is not None,
            leaves=None if unit.holder is None else unit.holder[0],
            enters=None if enters is None else enters[0],
            held=unit.held,
        )

    def reaches(
        self,
        unit: UnitRecord,
        task: Task,
        tasks: TaskList,
        gone: UnitRecord | None = None,
        X_WU: SE2 | None = None,
    ) -> bool:
        """Return whether a unit would reach the end of a task if another one was gone.

        ``gone`` is the other one, None for all others that can drive away; ``X_WU`` is where the unit sets
        out in the open, None for where it stands.
        """
        X_WE, enters = self._ends.pose_of(task, tasks), self._ends.port_of(task)
        if X_WE is None or unit.X_WU is None:
            return True  # nobody knows
        request = self.request(unit, X_WE, enters)
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
