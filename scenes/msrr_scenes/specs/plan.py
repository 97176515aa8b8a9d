"""Specifications of the steps of a plan, and the order in which they are carried out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from msrr_scenes.specs.bodies import MAX_UNITS
from msrr_scenes.specs.spec import Name, PortName, PoseSpec, Spec

#: Names of earlier steps; None stands for the step before.
After = Annotated[tuple[Name, ...], Field(max_length=MAX_UNITS)] | None


class DockStep(Spec):
    """One step of the plan: a unit docks to a port of another one."""

    unit: Name
    """Unit that docks."""
    port: Name = "front"
    """Active port of the docking unit."""
    to: PortName
    """Port that is docked to, written ``<unit>.<port>``."""
    calibrate: bool = False
    """Whether the unit first calibrates its camera and wheels by a drive in front of the port."""
    name: Name | None = None
    """Name of the step, for ``after``; by default that of the unit."""
    after: After = None
    """Names of the steps that have to be done before this one begins; by default the step before it in the
    plan. Steps that do not come after one another are carried out at the same time, which needs a base
    station."""

    @property
    def label(self) -> str:
        """Name by which other steps refer to this one."""
        return self.name or self.unit

    def __str__(self) -> str:
        """Return the step in words."""
        return f"{self.unit}.{self.port} to {self.to}"

    @property
    def target_unit(self) -> str:
        """Unit that is docked to."""
        return self.to.partition(".")[0]

    @property
    def target_port(self) -> str:
        """Name of the port that is docked to, without its unit."""
        return self.to.partition(".")[2]


class UndockStep(Spec):
    """A step in which a unit opens its lock and backs out of the port."""

    undock: Name
    """Unit that undocks."""
    name: Name | None = None
    """Name of the step, for ``after``; by default that of the unit."""
    after: After = None
    """Names of the steps that have to be done before this one begins; by default the step before it in the
    plan."""

    def __str__(self) -> str:
        """Return the step in words."""
        return f"{self.undock} undocks"

    @property
    def unit(self) -> str:
        """Unit that undocks."""
        return self.undock

    @property
    def label(self) -> str:
        """Name by which other steps refer to this one."""
        return self.name or self.undock


class MoveStep(Spec):
    """A step in which a unit drives to a pose."""

    move: Name
    """Unit that drives."""
    pose: PoseSpec = PoseSpec()
    """Pose of the axle where the unit is to stand, in the world frame."""
    name: Name | None = None
    """Name of the step, for ``after``; by default that of the unit."""
    after: After = None
    """Names of the steps that have to be done before this one begins; by default the step before it in the
    plan."""

    def __str__(self) -> str:
        """Return the step in words."""
        return f"{self.move} drives to ({self.pose.x_m:g}, {self.pose.y_m:g})"

    @property
    def unit(self) -> str:
        """Unit that drives."""
        return self.move

    @property
    def label(self) -> str:
        """Name by which other steps refer to this one."""
        return self.name or self.move


def _kind(step: Any) -> str:
    """Return the kind of a step as written: by the key that only steps of that kind have."""
    keys = step if isinstance(step, dict) else getattr(type(step), "model_fields", ())
    return next((kind for kind in ("undock", "move") if kind in keys), "dock")


PlanStep = Annotated[
    Annotated[DockStep, Tag("dock")]
    | Annotated[UndockStep, Tag("undock")]
    | Annotated[MoveStep, Tag("move")],
    Discriminator(_kind),
]


def predecessors(plan: Sequence[PlanStep]) -> tuple[tuple[int, ...], ...]:
    """Return for every step the indices of the steps that it comes directly after.

    Two steps of one unit keep the order of the plan, whether they say so or not. Names that no step has are
    left out, and a name that several steps have means all of them; the checks of a scene refuse both.
    """
    found: list[tuple[int, ...]] = []
    for index, step in enumerate(plan):
        if step.after is None:
            named = [index - 1] if index else []
        else:
            named = [i for i, other in enumerate(plan) if other.label in step.after]
        own = [i for i, other in enumerate(plan[:index]) if other.unit == step.unit]
        found.append(tuple(dict.fromkeys([*named, *own[-1:]])))
    return tuple(found)


def steps_of_target(plan: Sequence[PlanStep], index: int) -> tuple[int, ...]:
    """Return the steps behind which a docking begins although it names none of them.

    They are the steps of the unit that is docked to which neither come before the docking nor after it: a
    unit to which another one is docked does not drive.
    """
    step = plan[index]
    if not isinstance(step, DockStep):
        return ()
    before = ancestors(plan, index)
    return tuple(
        i
        for i, other in enumerate(plan)
        if other.unit == step.target_unit and i not in before and index not in ancestors(plan, i)
    )


def ancestors(plan: Sequence[PlanStep], index: int) -> tuple[int, ...]:
    """Return the indices of all steps that are done before a step begins, in order."""
    before, pending = set[int](), [index]
    direct = predecessors(plan)
    while pending:
        new = [i for i in direct[pending.pop()] if i not in before]
        before.update(new)
        pending += new
    return tuple(sorted(before))


def in_order(plan: Sequence[PlanStep]) -> list[int]:
    """Return the indices of all steps, each after those that it comes after, else as in the plan."""
    return sorted(range(len(plan)), key=lambda index: (len(ancestors(plan, index)), index))
