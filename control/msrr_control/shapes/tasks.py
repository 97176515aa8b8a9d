"""Tasks of a mission: who docks where, who leaves, who drives, and what has to come before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from graphlib import CycleError

from msrr_control.shapes.bodies import Body
from msrr_control.shapes.precedence import Lanes, Stay, precede, topological_order
from msrr_control.shapes.shape import Shape
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.plan import DockStep, PlanStep, UndockStep, predecessors, steps_of_target


class TaskKind(Enum):
    """What a unit does in a task; a unit that is in a port leaves it first, whatever the task."""

    DOCK = "dock"
    MOVE = "move"
    UNDOCK = "undock"


class TaskState(Enum):
    """How a task stands."""

    OPEN = "open"
    GRANTED = "granted"
    DONE = "done"
    GIVEN_UP = "given_up"


@dataclass(frozen=True)
class Task:
    """One task.

    Attributes:
        name: Name of the task; that of the place for the places of a shape.
        kind: What is to be done.
        unit: Unit that has to do it; None if any may.
        parent: Task whose unit holds the port, for a place of a shape; None otherwise.
        parent_unit: Unit that holds the port, where a plan names it; None otherwise.
        port: Passive port that is docked to; empty for other tasks.
        pose: Where the axle is to stand at the end of a move; None for other tasks.
        behind: Tasks that have to be granted before, so that their units go first.
        after: Tasks that have to be done before this one is granted.
        stays: Whether the unit is part of a shape from then on and is not asked to move out of the way.
    """

    name: str
    kind: TaskKind
    unit: str | None = None
    parent: str | None = None
    parent_unit: str | None = None
    port: str = ""
    pose: SE2 | None = None
    behind: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    stays: bool = False

    @property
    def depends_on(self) -> tuple[str, ...]:
        """Tasks without which this one makes no sense."""
        return self.after if self.parent is None else (self.parent, *self.after)


def shape_tasks(shape: Shape, lanes: Lanes, named: bool = False, X_WR: SE2 | None = None) -> list[Task]:
    """Return the tasks that build a shape, in an order in which they can be granted.

    Parents come before their children, and a unit before those that would stand in its lane. The places may
    be ``named`` by the units that have to take them. The pose of the root is None until it is chosen.

    Raises:
        SceneError: The shape cannot be built; the message says why.
    """
    problem = shape.problem(lanes.body)
    if problem is not None:
        raise SceneError(problem)
    poses = shape.poses(SE2(), lanes.body)
    before = {p.name: [p.parent] if p.parent else [] for p in shape.places}
    stays = [
        Stay(p.name, "", poses[p.name], p.name, port=f"{p.parent}.{p.port}" if p.parent else "")
        for p in shape.places
    ]
    for other, closed in precede(before, stays, lanes):
        raise SceneError(
            f"{other.begins} has to be built before {closed} and closes its lane (a parent comes before its "
            "child, and a unit before those that would stand in its lane); dock one of them elsewhere"
        )
    tasks = []
    for name in topological_order(before, before):
        place = shape.by_name[name]
        unit = name if named else None
        if place.parent is None:
            tasks.append(Task(name, TaskKind.MOVE, unit, pose=X_WR, stays=True))
        else:
            behind, parent = tuple(dict.fromkeys(before[name])), place.parent
            tasks.append(Task(name, TaskKind.DOCK, unit, parent, port=place.port, behind=behind, stays=True))
    return tasks


def plan_tasks(
    steps: Sequence[PlanStep],
    holders: Mapping[str, str],
    lanes: Lanes,
    there: Mapping[str, SE2] | None = None,
) -> list[Task]:
    """Return the tasks of an explicit plan, in an order in which they can be granted.

    A step without ``after`` comes after the one before it in the plan, and two steps of one unit keep the
    order of the plan, whether they say so or not. A docking that may come before a step of the unit that it
    docks to or after it is granted behind that step. As far as all this leaves the order open, a step is
    granted before those whose units would stand in the lane of its port.

    ``holders`` has the port ``<unit>.<port>`` that each unit is locked to at the start, and ``there`` the
    pose of every unit that has been seen. Without poses only units that are locked to each other by then, or
    that drive to a pose that the plan names, are compared.

    Raises:
        SceneError: A step comes after one that does not exist, two steps have one name, a ring of steps
            waits for itself, or a unit that is locked to others closes a lane in every order of the steps.
    """
    names = [step.label for step in steps]
    for step, name in zip(steps, names, strict=True):
        for earlier in step.after or ():
            if earlier not in names:
                raise SceneError(f"step {name!r} comes after {earlier!r}; steps: {', '.join(names)}")
        if names.count(name) > 1:
            raise SceneError(f"two steps are named {name!r}; give one of them another `name`")
    after = {names[k]: [names[i] for i in earlier] for k, earlier in enumerate(predecessors(steps))}
    before = {
        name: [*after[name], *(names[i] for i in steps_of_target(steps, k))] for k, name in enumerate(names)
    }
    by_name = dict(zip(names, steps, strict=True))
    try:
        in_order = [by_name[name] for name in topological_order(names, before)]
    except CycleError as error:
        raise SceneError(f"steps wait for each other in a ring: {', '.join(error.args[1])}") from error
    for other, name in precede(before, _stays(in_order, holders, lanes.body, {}), lanes):
        since = "since the start" if other.begins is None else f"since step {other.begins!r}"
        raise SceneError(
            f"step {name!r} cannot be done: {other.unit!r} stands in the lane of its port by then, {since}; "
            "change `after` of one of them, or name another port"
        )
    if there:
        # Who can never get by is told when everything else is done: only then is it certain.
        precede(before, _stays(in_order, holders, lanes.body, there), lanes)
    behind = {name: tuple(b for b in dict.fromkeys(before[name]) if b not in after[name]) for name in names}
    return [
        _plan_task(by_name[name], tuple(after[name]), behind[name])
        for name in topological_order(names, before)
    ]


def _stays(
    steps: Sequence[PlanStep], holders: Mapping[str, str], body: Body, there: Mapping[str, SE2]
) -> list[Stay]:
    """Return where all units stand between their steps, which are given in an order to be done in.

    Poses of units that have not been seen are in the frame of the root to which they are locked.
    """

    def start(unit: str) -> Stay:
        holder, _, port = holders.get(unit, "").partition(".")
        if not holder:
            return Stay(unit, *(("", there[unit]) if unit in there else (unit, SE2())), may_make_way=True)
        base = start(holder)
        pose = body.docked(base.pose, port)
        return Stay(unit, base.frame, pose, port=holders[unit], carrier=base.base)

    holding = [port.partition(".")[0] for port in holders.values()]
    here = {unit: start(unit) for unit in [*there, *holders, *holding]}
    left = []
    for step in steps:
        label, unit = step.label, step.unit
        left.append(here.get(unit, start(unit))._replace(ends=label))
        if isinstance(step, DockStep):
            base = here.setdefault(step.target_unit, start(step.target_unit))
            pose = body.docked(base.pose, step.target_port)
            here[unit] = Stay(unit, base.frame, pose, label, port=step.to, carrier=base.base)
        elif isinstance(step, UndockStep):
            here[unit] = Stay(unit, f"after {label}", SE2(), label, may_make_way=True)
        else:
            here[unit] = Stay(unit, "", step.pose.nominal, label, may_make_way=True)
    return [*left, *here.values()]


def _plan_task(step: PlanStep, after: tuple[str, ...], behind: tuple[str, ...]) -> Task:
    if isinstance(step, DockStep):
        return Task(
            step.label,
            TaskKind.DOCK,
            step.unit,
            parent_unit=step.target_unit,
            port=step.target_port,
            behind=behind,
            after=after,
        )
    if isinstance(step, UndockStep):
        return Task(step.label, TaskKind.UNDOCK, step.unit, behind=behind, after=after)
    return Task(step.label, TaskKind.MOVE, step.unit, pose=step.pose.nominal, behind=behind, after=after)
