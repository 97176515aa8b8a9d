"""The coordinator: a base station that leads many units at once through a mission.

It knows the estimates of the overhead camera and what units report over the radio, nothing else. Ground that
it has granted is freed by reported or seen progress alone, never because a unit fell silent.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

from msrr_control.coordination.assemblies import locate
from msrr_control.coordination.dispatcher import Dispatcher
from msrr_control.coordination.interlock import Interlock
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.mission import Mission, Patience
from msrr_control.coordination.past_tasks import PastTasks
from msrr_control.coordination.recall import Recall
from msrr_control.coordination.route_release import RouteRelease
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.siting import Siting, check_shapes
from msrr_control.coordination.task_list import TaskList
from msrr_control.coordination.unit_messages import next_authority, status_of
from msrr_control.coordination.unit_states import UnitStates
from msrr_control.coordination.watch import Watch
from msrr_control.shapes.reconfiguration import assembly_ports
from msrr_control.shapes.tasks import TaskState
from msrr_scenes.errors import SceneError
from msrr_scenes.messages import NS_PER_S, GlobalPose, ObstacleEstimate, seconds
from msrr_scenes.messages.coordination import (
    Authority,
    MissionState,
    MissionStatus,
    UnitReport,
    UnitState,
)

#: A unit that catches up with the desired point of its path drives no faster than so many times its pace.
_CATCHES_UP = 2.0


class Coordinator:
    """A state machine: reports and estimates in, authorities out; the same inputs give the same outputs."""

    def __init__(self, mission: Mission, units: Iterable[str], setup: CoordinationSetup) -> None:
        """Begin before anything was seen or heard of the units, which are given by name.

        Raises:
            SceneError: The shape cannot be built, or the plan contradicts itself.
        """
        self._setup, self._patience = setup, Patience()
        fastest_mps = _CATCHES_UP * setup.travel.cruise_mps
        self._units = {
            name: UnitRecord(name, retreat_m=setup.retreat_m, fastest_mps=fastest_mps) for name in units
        }
        self._interlock = Interlock(self._units, setup.lanes.body)
        self._dispatcher = Dispatcher(setup, self._units, self._interlock, mission.one_by_one)
        check_shapes(mission, setup.lanes)
        for name, port in mission.holders.items():
            holder, _, passive = port.partition(".")
            self._units[name].holder = (holder, passive)
        # The root of an assembly that becomes a shape stays where it is. In a plan it stands free like others
        # to which somebody is docked: when all have left it, it makes way.
        docked = assembly_ports(mission.holders) if mission.shape and mission.holders else mission.holders
        for name in docked:
            self._units[name].state = UnitState.DOCKED
        self._state = MissionState.RUNNING
        self._begun, self._start_ns = False, 0
        self._sent_ns: int | None = None
        self._tried_ns: int | None = None
        self._hopeless_ns: int | None = None
        self._sited_ns: int | None = None  # when there was no site without units that may be found
        self._replans = self._most_replans = 0  # how often routes were planned anew, and may be by now
        self._past = PastTasks()
        self._watch = Watch(self._patience, setup.tolerance)
        self._states = UnitStates(self._units, self._watch)
        self._releases = RouteRelease(self._units, self._watch, self._dispatcher)
        self._set_out(mission)

    def _set_out(self, mission: Mission) -> None:
        """Begin a mission, or the next one of several."""
        self._mission, self._siting = mission, Siting(mission, self._setup)
        self._recall = Recall(self._patience)
        self._reason, self._tasks = "waits for the first sight of the units", TaskList(())
        for unit in self._units.values():
            unit.task = None
        self._advance()

    def _advance(self) -> None:
        """Begin to count anew what went wrong: what is left to do may need other ways."""
        self._changed = True
        self._most_replans = self._replans + self._patience.replans
        for unit in self._units.values():
            unit.evasions = unit.recalls = 0

    def receive(self, report: UnitReport, now_ns: int) -> None:
        """Take in a report that arrived over the radio."""
        self._units[report.unit].receive(report, now_ns)

    def observe(
        self, bodies: Sequence[GlobalPose], now_ns: int, obstacles: tuple[ObstacleEstimate, ...] = ()
    ) -> None:
        """Take in the estimates of the overhead camera."""
        for body in bodies:
            unit = self._units[body.name]
            if unit.X_WU is None and self._state is MissionState.RUNNING:
                self._changed = True
                self._tasks.take_up_again()  # nobody could do them without it
            unit.observe(body, now_ns)
        self._dispatcher.ends.obstacles = obstacles

    def step(self, now_ns: int) -> list[Authority]:
        """Advance to ``now_ns`` and return the authorities to broadcast, none between two due times."""
        if not self._begun:
            self._begun, self._start_ns = True, now_ns
            self._watch.restart(now_ns)
            self._watch.advance(now_ns)
        if self._state is MissionState.RUNNING:
            done = self._tasks.advance
            changed, missed = self._states.update(self._tasks, now_ns)
            if self._tasks.advance > done:
                self._advance()
            locate(self._units, self._setup.lanes.body)
            self._changed |= changed
            for _ in range(missed):
                self._plan_anew(now_ns)
            self._choose_site(now_ns)
            if self._siting.chosen and self._state is MissionState.RUNNING:
                self._extend()
                self._release(now_ns)
                self._dispatch(now_ns)
                self._extend()
                self._conclude(now_ns)
        self._watch.advance(now_ns)
        if self._sent_ns is not None and now_ns - self._sent_ns < round(NS_PER_S / self._patience.rate_hz):
            return []
        self._sent_ns = now_ns
        expires_ns = now_ns + round(self._patience.expires_s * NS_PER_S)
        units = self._units.values()
        sent = [unit for unit in units if unit.track is not None and not self._is_to_brake(unit, now_ns)]
        return [next_authority(unit, units, now_ns, expires_ns) for unit in sent]

    def _is_to_brake(self, unit: UnitRecord, now_ns: int) -> bool:
        """Return whether a unit is sent no authority: it failed, is or will be lost, or is recalled."""
        ends = unit.out_of_action or self._watch.is_to_stop(unit, now_ns)
        return ends or self._recall.is_recalled(unit)

    @property
    def state(self) -> MissionState:
        """Whether the mission goes on, or how it has ended."""
        return self._state

    def status(self, now_ns: int) -> MissionStatus:
        """Return how the mission stands."""
        return MissionStatus(
            stamp_ns=now_ns,
            state=self._state,
            shape=self._mission.name,
            done=self._past.done + self._tasks.names(TaskState.DONE),
            given_up=(*(task for _, task in self._past.undone), *self._tasks.names(TaskState.GIVEN_UP)),
            units=tuple(map(status_of, self._units.values())),
            replans=self._replans,
            reason=self._reason,
        )

    # Where the shape stands.

    def _choose_site(self, now_ns: int) -> None:
        """Choose the site of a shape or the order of a plan when all are seen; again if a root fails.

        Where there is none without units that may be found, they are waited for.
        """
        siting, units = self._siting, list(self._units.values())
        if siting.chosen:
            shape = self._mission.shape
            taken_by = None if shape is None else self._dispatcher.assigner.wanted.get(shape.root.name)
            failed = taken_by is not None and self._units[taken_by].state is UnitState.FAILED
            if not (failed and self._root_is_open) or not siting.may_move(units):
                return
            siting.move()
        if self._sited_ns is not None and seconds(now_ns - self._sited_ns) < self._patience.look_again_s:
            return
        unseen = [unit.name for unit in units if unit.X_WU is None]
        patience_s = self._patience.seen_s if siting.sees_root(units) else self._patience.lost_s
        if unseen and seconds(now_ns - self._start_ns) < patience_s:
            return
        try:
            tasks, wanted = siting.choose(units, self._dispatcher.ends.obstacles)
        except SceneError as error:
            if any(self._watch.may_be_found(unit, now_ns) for unit in units):
                siting.chosen, self._sited_ns = False, now_ns
                return
            missing = [f"not seen: {', '.join(unseen)}"] if unseen else []
            out = [f"{unit.name}: {unit.reason}" for unit in units if unit.out_of_action]
            for name in self._tasks.names(TaskState.OPEN):  # those of the site before
                self._tasks.give_up(name, str(error))
            self._end(MissionState.INCOMPLETE, "; ".join([str(error), *missing, *out]))
            return
        self._tasks, self._dispatcher.assigner.wanted = TaskList(tasks), wanted
        for unit in units:
            unit.evasions = 0  # others are in the way there
        self._changed, self._reason = True, ""

    # Who gets a route, and who loses it.

    def _release(self, now_ns: int) -> None:
        """Take the routes from units that stand and cannot go on."""
        released = self._releases.step(self._recall, self._tasks, self._root_is_open, now_ns)
        self._changed |= released.any
        if released.hindered:
            self._plan_anew(now_ns)

    @property
    def _root_is_open(self) -> bool:
        """Whether the unit that was to be the root of the shape has missed its place, or has failed."""
        shape = self._mission.shape
        return shape is not None and shape.root.name in self._tasks.names(TaskState.OPEN)

    def _plan_anew(self, now_ns: int) -> None:
        """Count that routes are planned anew, and give up what is open when that has happened too often."""
        self._replans += 1
        self._watch.restart(now_ns)
        if self._replans > self._most_replans:
            for name in self._tasks.names(TaskState.OPEN):
                self._tasks.give_up(name, f"routes were planned anew {self._replans} times")

    def _dispatch(self, now_ns: int) -> None:
        """Find routes for what is open, or other hops, when something has changed and now and then."""
        if not self._tasks.open or self._state is not MissionState.RUNNING:
            return
        waits = self._patience.retry_s if self._dispatcher.waits_for_tracks else self._patience.look_again_s
        due = self._tried_ns is None or seconds(now_ns - self._tried_ns) >= waits
        if not self._changed and not due:
            return
        self._changed, self._tried_ns = False, now_ns
        if self._dispatcher.dispatch(self._tasks, now_ns):
            self._watch.restart(now_ns)
        elif self._all_rest(now_ns):
            self._hop_otherwise(now_ns)

    def _all_rest(self, now_ns: int) -> bool:
        """Return whether nobody is under way, and nobody who is lost or was never seen is waited for."""
        return not any(u.under_way or self._watch.may_be_found(u, now_ns) for u in self._units.values())

    def _extend(self) -> None:
        """Let everybody drive as far as the others allow, the first in order first."""
        for unit in sorted(self._units.values(), key=lambda u: u.order):
            if unit.under_way and (unit.task is None or self._tasks.lost_base(unit.task) is None):
                self._interlock.extend(unit)

    def _conclude(self, now_ns: int) -> None:
        """End the mission if everything is done, or give up what nobody can do."""
        units = self._units.values()
        if self._tasks.ended and not any(unit.under_way for unit in units):
            if self._failed and self._hop_otherwise(now_ns):
                return
            failed = self._failed
            if not failed and self._dispatcher.sends_back(self._tasks):
                self._changed = True
                return
            if not failed and self._mission.then is not None:
                self._past.finish(self._tasks)
                docks = {unit.name: ".".join(unit.holder) for unit in self._units.values() if unit.holder}
                self._set_out(replace(self._mission.then, holders=docks))
            elif not failed:
                self._end(MissionState.COMPLETE, "all tasks are done")
            else:
                told = "; ".join(f"{name}: {why}" for name, why in failed.items())
                out = [f"{u.name}: {u.reason}" for u in units if u.out_of_action and not _is_told(u, told)]
                self._end(MissionState.INCOMPLETE, "; ".join([told, *out]))
            return
        if not self._all_rest(now_ns) or self._changed or self._hopeless_ns is None:
            self._hopeless_ns = now_ns
        if seconds(now_ns - self._hopeless_ns) > self._patience.hopeless_s and self._tasks.open:
            self._hopeless_ns, self._changed = now_ns, True
            if self._siting.may_move(self._units.values()):
                self._siting.move()
                for unit in self._units.values():
                    if unit.state is UnitState.DOCKED:  # the root, to which nobody has docked
                        unit.stand(now_ns, "the shape is built elsewhere")
                return
            first = next(iter(self._tasks.ready()), self._tasks.open[0])
            why = self._dispatcher.hindrance(first, self._tasks)
            dead = ", ".join(u.name for u in self._units.values() if u.out_of_action)
            why += f"; out of action: {dead}" if dead else ""
            self._tasks.give_up(first.name, why, hopeless=True)

    @property
    def _failed(self) -> dict[str, str]:
        """Why each task that was given up was."""
        return {task: why for (_, task), why in self._past.undone.items()} | self._tasks.reasons

    def _hop_otherwise(self, now_ns: int) -> bool:
        """Replace hops that cannot be made if others lead on from here; return whether they do.

        They are searched for only when an obstacle, or who can move, is another than at the search before.
        """
        chosen = self._siting.choose_again(self._units.values(), self._dispatcher.ends.obstacles)
        if chosen is None:
            return False
        tasks, whole = chosen
        if not tasks and not whole:
            return False
        # One in a port even if all places are taken: it may have opened its lock before it failed.
        out = {u.name for u in self._units.values() if u.out_of_action and (u.docks or not whole)}
        hopping = {str(task.unit) for task in tasks}
        why = partial(self._dispatcher.hindrance, tasks=self._tasks)
        self._past.replace(self._tasks, hopping, out, whole, why)
        self._tasks, self._changed = TaskList(tasks), True
        for unit in self._units.values():
            unit.task, unit.evasions = None, 0
        self._plan_anew(now_ns)
        return True

    def _end(self, state: MissionState, reason: str) -> None:
        self._state, self._reason = state, reason


def _is_told(unit: UnitRecord, text: str) -> bool:
    """Return whether a text says already that a unit is out of action, and why."""
    return any(f" {unit.name} {how}: {unit.reason}" in text for how in ("failed", "has failed", "is lost"))
