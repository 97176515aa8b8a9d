"""Who loses a route: units that stand and cannot go on by it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from msrr_control.coordination.dispatcher import Dispatcher
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.recall import Recall
from msrr_control.coordination.task_list import TaskList
from msrr_control.coordination.watch import Watch


class Released(NamedTuple):
    """Whether any unit lost its route, and whether one did other than by a task that is open again.

    Such a task was counted when it was opened: many units may lose their routes by one task.
    """

    any: bool
    hindered: bool


class RouteRelease:
    """Takes the routes from units that are held, drive in vain, or wait for what does not come."""

    def __init__(self, units: Mapping[str, UnitRecord], watch: Watch, dispatcher: Dispatcher) -> None:
        """Bind to the ledger, whose records are changed."""
        self._units, self._watch, self._dispatcher = units, watch, dispatcher

    def step(self, recall: Recall, tasks: TaskList, root_is_open: bool, now_ns: int) -> Released:
        """Take the routes of the units that have stopped; their tasks are open again.

        ``root_is_open`` is whether the root of the shape has missed its place or failed. All others are on
        the way to where it was to stand, and it gets no route through what they have still to drive. They
        are stopped at once, so that it need not wait until they have come as far as they may.
        """
        quiet = self._watch.nobody_moves(self._units.values(), now_ns)
        released = hindered = False
        for unit in self._units.values():
            in_lane = self._dispatcher.ahead_in_lane(unit)
            lost = None if unit.task is None else tasks.lost_base(unit.task)
            vain = in_lane is not None or (lost is not None and root_is_open)
            held = recall.has_stopped(unit, now_ns, vain)
            blocker = None if unit.blocked_by is None else self._units[unit.blocked_by]
            for_ever = blocker is not None and not blocker.under_way
            stuck = self._watch.waits(unit) and (lost is not None or for_ever or quiet)
            if not held and not stuck:
                continue
            if in_lane is not None:
                why = f"{in_lane} stands in the lane to its port"
            elif lost is not None:
                why = f"{lost} is open again"
            elif held:
                why = f"was held {unit.progress:.2f} m along its way"
            else:
                why = f"waited for {unit.blocked_by}"
            if unit.task is not None:
                tasks.reopen(unit.task)
            unit.stand(now_ns, why)
            unit.held = held and not vain
            if unit.holder is None:
                unit.stand_down()
            elif held:
                unit.track = None  # its authority must not be renewed: it reaches further than the unit came
            self._watch.restart(now_ns)
            released, hindered = True, hindered or lost is None
        return Released(released, hindered)
