"""Tasks of a mission: who docks where, who leaves, who drives, and what has to come before."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from graphlib import CycleError

from msrr_control.coordination.precedence import topological_order
from msrr_control.coordination.shape import Shape
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


def shape_tasks(shape: Shape, before: Mapping[str, Iterable[str]], X_WR: SE2, named: bool) -> list[Task]:
    """Return the tasks that build a shape with its root at ``X_WR``, in an order to grant them in.

    Args:
        shape: The shape.
        before: Its precedence, in that order; see :func:`~msrr_control.coordination.precedence.precedence`.
        X_WR: Pose of the root.
        named: Whether places are named by the units that have to take them.
    """
    tasks = []
    for name, earlier in before.items():
        place = shape.by_name[name]
        unit = name if named else None
        if place.parent is None:
            tasks.append(Task(name, TaskKind.MOVE, unit, pose=X_WR, stays=True))
        else:
            tasks.append(
                Task(
                    name,
                    TaskKind.DOCK,
                    unit,
                    parent=place.parent,
                    port=place.port,
                    behind=tuple(earlier),
                    stays=True,
                )
            )
    return tasks


def plan_tasks(steps: Sequence[PlanStep]) -> list[Task]:
    """Return the tasks of an explicit plan, in an order in which they can be granted.

    A step without ``after`` comes after the one before it in the plan, and two steps of one unit keep the
    order of the plan, whether they say so or not. A docking that may come before a step of the unit that it
    docks to or after it is granted behind that step.

    Raises:
        SceneError: A step comes after one that does not exist, two steps have one name, or a ring of steps
            waits for itself.
    """
    names = [step.label for step in steps]
    for step, name in zip(steps, names, strict=True):
        for earlier in step.after or ():
            if earlier not in names:
                raise SceneError(f"step {name!r} comes after {earlier!r}; steps: {', '.join(names)}")
        if names.count(name) > 1:
            raise SceneError(f"two steps are named {name!r}; give one of them another `name`")
    before = predecessors(steps)
    tasks = {
        name: _plan_task(
            step,
            after=tuple(names[i] for i in before[k]),
            behind=tuple(names[i] for i in steps_of_target(steps, k)),
        )
        for k, (step, name) in enumerate(zip(steps, names, strict=True))
    }
    order = topological_order(names, {t.name: (*t.after, *t.behind) for t in tasks.values()})
    if isinstance(order, CycleError):
        raise SceneError(f"steps wait for each other in a ring: {', '.join(order.args[1])}")
    return [tasks[name] for name in order]


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
        return Task(step.label, TaskKind.UNDOCK, step.unit, after=after)
    return Task(step.label, TaskKind.MOVE, step.unit, pose=step.pose.nominal, after=after)
