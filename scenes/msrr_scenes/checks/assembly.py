"""Checks of the units that are locked together when a trial begins."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_scenes.checks.problems import Problem
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import PoseSpec


def assembly_problems(scene: Scene) -> list[Problem]:
    """Return ports that are used twice, rings, and poses of units whose place is their seat."""
    problems = [*_twice(scene), *_rings(scene)]
    if problems:
        return problems
    for unit, port in scene.holders.items():
        if scene.units[unit].pose != PoseSpec():
            root = _chain(scene, unit)[-1]
            text = (
                f"the unit is locked to {port}, which says where it stands; remove the pose, or move {root!r}"
            )
            problems.append(Problem(("units", unit, "pose"), text))
    return problems


def _twice(scene: Scene) -> Iterator[Problem]:
    """Yield units that are locked to two ports, and ports that hold two units."""
    locked: dict[str, str] = {}
    held: dict[str, str] = {}
    for i, dock in enumerate(scene.assembled_docks):
        other = locked.setdefault(dock.unit, dock.to)
        if other != dock.to:
            text = f"{dock.unit!r} is locked to {other} already, and has one active port; remove one of them"
            yield Problem(("assembled", i), text)
        first = held.setdefault(dock.to, dock.unit)
        if first != dock.unit:
            yield Problem(("assembled", i), f"{dock.to} holds {first!r} already; name another port")
        elif list(scene.assembled_docks).index(dock) != i:
            yield Problem(("assembled", i), "this pair is named twice; remove one of them")


def _rings(scene: Scene) -> Iterator[Problem]:
    for i, dock in enumerate(scene.assembled_docks):
        chain = _chain(scene, dock.unit)
        if dock.unit in chain[1:]:
            yield Problem(("assembled", i), f"a ring ({' to '.join(chain)}); remove one of its pairs")
            return


def _chain(scene: Scene, unit: str) -> list[str]:
    """Return a unit, the one that it is locked to, and so on up to the root, or once around a ring."""
    chain = [unit]
    while chain[-1] in scene.holders and chain.count(chain[-1]) < 2:
        chain.append(scene.holders[chain[-1]].partition(".")[0])
    return chain
