"""Checks of the plan and of the faults: every step can begin, and no two faults contradict each other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from graphlib import CycleError, TopologicalSorter

from msrr_scenes.checks.moves import move_problems
from msrr_scenes.checks.problems import KeyPath, Problem
from msrr_scenes.checks.references import camera_names, step_key, unknown_unit
from msrr_scenes.errors import nearest
from msrr_scenes.messages import OVERHEAD
from msrr_scenes.placement.placement import FRONT
from msrr_scenes.specs.faults import CameraBlackout, EncoderStuck, MarkerHidden, PortPlugged, SeatSwitchStuck
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
from msrr_scenes.wording import counted


def plan_problems(scene: Scene) -> list[Problem]:
    """Return steps that can never begin: by their order, or by what the steps before them have locked."""
    disorder = list(_order_problems(scene))
    if disorder or scene.coordinated:
        return disorder or list(_lock_problems(scene))
    overlap = list(_steps_at_once(scene))
    return overlap or [
        *_busy_units(scene),
        *_busy_ports(scene),
        *_locked_already(scene),
        *_carriers(scene),
    ]


def mission_problems(scene: Scene) -> list[Problem]:
    """Return what is missing for a mission, or contradicts it."""
    problems = []
    if scene.shape is None and not scene.plan:
        problems.append(Problem(("plan",), "expected at least 1 entry, or a shape"))
    if scene.shape is not None and scene.plan:
        problems.append(Problem(("plan",), "a scene has a plan or a shape, not both; remove one of them"))
    if not scene.coordinated:
        return problems
    problems += _shape_problems(scene)
    for i, step in enumerate(scene.plan):
        if isinstance(step, DockStep) and step.calibrate:
            text = "only units on their own calibrate, and a base station leads these; leave it out"
            problems.append(Problem(("plan", i, "calibrate"), text))
        if isinstance(step, DockStep) and step.port != FRONT:
            text = f"units that a base station leads dock with their port {FRONT}, found {step.port!r}"
            problems.append(Problem(("plan", i, "port"), text))
    problems += move_problems(scene)
    overhead = scene.cameras.overhead
    if overhead is None:
        text = "a base station leads the units by it; add one, such as overhead: {}"
        problems.append(Problem(("cameras", "overhead"), text))
    elif overhead.localisation != type(overhead.localisation)():
        text = "these errors are those of one docking unit; a base station leads several, so leave them out"
        problems.append(Problem(("cameras", "overhead", "localisation"), text))
    for k, silence in enumerate(scene.radio.silences if scene.radio is not None else ()):
        for name in silence.units:
            unknown = unknown_unit(scene, name)
            if unknown is not None:
                problems.append(Problem(("radio", "silences", k, "units"), unknown))
    return problems


def _shape_problems(scene: Scene) -> Iterator[Problem]:
    """Yield places for which there are no units."""
    for k, shape in enumerate(scene.shape or ()):
        path: KeyPath = scene.shape_key(k)
        for name in shape.tree or {} if shape.named else {}:
            unknown = unknown_unit(scene, name)
            if unknown is not None:
                yield Problem((*path, name), unknown)
        if shape.count > len(scene.units):
            text = f"{counted(shape.count, 'place')}, but {counted(len(scene.units), 'unit')}"
            text += "; add units, or take places out"
            yield Problem(path, text)


def _order_problems(scene: Scene) -> Iterator[Problem]:
    """Yield names in ``after`` that do not name one step, and steps that wait for themselves."""
    labels = [step.label for step in scene.plan]
    for i, step in enumerate(scene.plan):
        for j, name in enumerate(step.after or ()):
            path: KeyPath = ("plan", i, "after", j)
            if name not in labels:
                near = nearest(name, labels)
                yield Problem(path, f"no step named {name!r}{near} Steps: {', '.join(labels)}")
            elif labels.count(name) > 1:
                yield Problem(path, f"{labels.count(name)} steps are named {name!r}; give each a `name`")
        if i in ancestors(scene.plan, i):
            text = f"step {labels[i]!r} waits for itself; take one `after` out"
            yield Problem(("plan", i, "after"), text)


def _steps_at_once(scene: Scene) -> Iterator[Problem]:
    """Yield steps that may be carried out at the same time as an earlier one of the list."""
    before = [ancestors(scene.docks, i) for i in range(len(scene.docks))]
    for j, step in enumerate(scene.docks):
        for i, other in enumerate(scene.docks[:j]):
            if i not in before[j] and j not in before[i]:
                text = (
                    f"the steps {other.label!r} and {step.label!r} may be carried out at the same time, and "
                    "units on their own do not know of each other; add `radio: {}` to the scene, so that a "
                    "base station leads them, or put the steps in order"
                )
                yield Problem(("plan", j, "after"), text)
                break


def _busy_units(scene: Scene) -> Iterator[Problem]:
    first: dict[tuple[str, str], int] = {}
    for i, step in enumerate(scene.docks):
        earlier = first.setdefault((step.unit, step.port), i)
        if earlier != i:
            text = (
                f"{step.unit!r} is still docked by its port {step.port} since plan step {earlier}, and units "
                "on their own do not undock; add `radio: {}` to the scene, so that a base station leads "
                "them, or remove one of the steps"
            )
            yield Problem(("plan", i, "unit"), text)


def _busy_ports(scene: Scene) -> Iterator[Problem]:
    first: dict[str, int] = {}
    for i, step in enumerate(scene.docks):
        earlier = first.setdefault(step.to, i)
        if earlier != i and scene.docks[earlier].unit != step.unit:
            taken = f"{scene.docks[earlier].unit!r} docks to {step.to} in plan step {earlier}"
            text = f"the port is taken: {taken}; name another port"
            yield Problem(("plan", i, "to"), text)


def _carriers(scene: Scene) -> Iterator[Problem]:
    """Yield steps of units to which another one is docked by then."""
    order = in_order(scene.docks)
    for n, i in enumerate(order):
        unit = scene.docks[i].unit
        carried = next((scene.docks[j].unit for j in order[:n] if scene.docks[j].target_unit == unit), None)
        if carried is not None:
            drives = "only a unit that carries no other one drives"
            text = f"{carried!r} is locked to {unit!r} by then, and {drives}; let {unit!r} dock before it"
            yield Problem(("plan", i, "unit"), text)


def _locked_already(scene: Scene) -> Iterator[Problem]:
    group = {unit: {unit} for unit in scene.units}
    order = in_order(scene.docks)
    for n, i in enumerate(order):
        step = scene.docks[i]
        own, other = group[step.unit], group[step.target_unit]
        if own is other and (step.unit, step.port) not in {
            (scene.docks[j].unit, scene.docks[j].port) for j in order[:n]
        }:
            text = f"{step.unit!r} and {step.target_unit!r} are locked together by then; remove the step"
            yield Problem(("plan", i, "to"), text)
        own |= other
        for unit in own:
            group[unit] = own


def _lock_problems(scene: Scene) -> Iterator[Problem]:
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


def fault_problems(scene: Scene) -> list[Problem]:
    """Return faults that contradict another one: two of one kind in one place cannot both hold."""
    problems = []
    first: dict[tuple[str, ...], int] = {}
    for i, fault in enumerate(scene.faults):
        if isinstance(fault, CameraBlackout):
            continue  # a camera can fail several times
        part: tuple[str, ...] = ()
        if isinstance(fault, PortPlugged):
            part = (fault.port,)
        elif isinstance(fault, EncoderStuck):
            part = (fault.wheel,)
        earlier = first.setdefault((fault.kind, fault.unit, *part), i)
        if earlier != i:
            text = f"fault {earlier} is of this kind and in this place, too; keep one of them"
            problems.append(Problem(("faults", i), text))
    return problems


def idle_faults(scene: Scene) -> Iterator[Problem]:
    """Yield faults that change nothing, for units on their own do nothing but the docks of the plan."""
    if scene.coordinated:
        return
    docking = {step.unit: None for step in scene.docks}
    docked_to = {step.target_unit: None for step in scene.docks}
    for i, fault in enumerate(scene.faults):
        if isinstance(fault, CameraBlackout):
            acting = [name for name in camera_names(scene) if name.partition("/")[0] in {OVERHEAD, *docking}]
            key, named = "camera", fault.camera
        elif isinstance(fault, PortPlugged):
            key, named, acting = "port", f"{fault.unit}.{fault.port}", [step.to for step in scene.docks]
            if named in acting and min(fault.attempts, default=math.inf) > scene.docking.attempts:
                text = f"none of these is among docking.attempts = {scene.docking.attempts}; name one that is"
                yield Problem(("faults", i, "attempts"), text)
        elif isinstance(fault, (MarkerHidden, SeatSwitchStuck)):
            key, named, acting = "unit", fault.unit, [*docked_to]
            if isinstance(fault, MarkerHidden) and scene.cameras.overhead is not None:
                continue  # the tag on top counts as well
        else:
            key, named, acting = "unit", fault.unit, [*docking]
        if named not in acting:
            text = f"changes nothing in this plan; {fault.kind} acts on {', '.join(acting)}"
            yield Problem(("faults", i, key), f"{text}; name that, or leave the fault out")
