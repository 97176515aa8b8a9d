"""Checks of a plan that a base station carries out: the locks that are closed by then allow every step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from graphlib import CycleError, TopologicalSorter

from msrr_scenes.loading.problems import Problem
from msrr_scenes.loading.reference_checks import step_key
from msrr_scenes.specs.plan import (
    DockStep,
    PlanStep,
    UndockStep,
    ancestors,
    in_order,
    predecessors,
    steps_of_target,
)
from msrr_scenes.specs.scene import Scene


def lock_problems(scene: Scene) -> Iterator[Problem]:
    """Yield steps that can never be carried out for the locks of the start and of the steps before them.

    What another step does at the same time is left to the trial, except for what no order of the two allows.
    """
    plan = scene.plan
    yield from _rings(plan)
    before = [ancestors(plan, i) for i in range(len(plan))]
    for i, step in enumerate(plan):
        locks = _locks_after(scene, before[i])
        at_once = [j for j in range(len(plan)) if j != i and j not in before[i] and i not in before[j]]
        for j in at_once:
            locks.pop(plan[j].unit, None)
        carried = [unit for unit, port in locks.items() if port.partition(".")[0] == step.unit]
        if carried:
            text = (
                f"{carried[0]!r} is locked to {locks[carried[0]]} by then, and only a unit that carries no "
                f"other one drives; let {carried[0]!r} undock before"
            )
            yield Problem(("plan", i, step_key(step)), text)
        elif isinstance(step, UndockStep) and step.unit not in locks and not at_once:
            yield Problem(("plan", i, "undock"), f"{step.unit!r} is not docked by then; remove the step")
        elif isinstance(step, DockStep):
            taken = [unit for unit, port in locks.items() if port == step.to]
            if taken == [step.unit]:
                yield Problem(("plan", i, "to"), f"{step.unit!r} is docked there by then; remove the step")
            elif taken:
                text = f"the port is taken: {taken[0]!r} is docked to it by then; name another port"
                yield Problem(("plan", i, "to"), text)


def _rings(plan: Sequence[PlanStep]) -> Iterator[Problem]:
    """Yield dockings of which each would have to begin behind the next."""
    before = predecessors(plan)
    graph = {i: (*before[i], *steps_of_target(plan, i)) for i in range(len(plan))}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        ring = error.args[1]
        names = ", ".join(repr(plan[i].label) for i in ring[1:])
        text = (
            f"the steps {names} wait for each other, because a unit to which another one is docked does not "
            "drive; take one of them out, or put them in order"
        )
        yield Problem(("plan", max(ring)), text)


def _locks_after(scene: Scene, steps: tuple[int, ...]) -> dict[str, str]:
    """Return the port that each unit is locked to when these steps are done."""
    locks: dict[str, str] = dict(scene.holders)
    for j in in_order(scene.plan):
        if j in steps:
            step = scene.plan[j]
            locks.pop(step.unit, None)
            if isinstance(step, DockStep):
                locks[step.unit] = step.to
    return locks
