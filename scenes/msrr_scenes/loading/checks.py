"""Checks across the fields of a scene: what each value allows alone may still contradict another."""

from __future__ import annotations

from msrr_scenes.errors import GeometryError, SceneError
from msrr_scenes.loading.geometry_checks import geometry_problems
from msrr_scenes.loading.problems import Problem
from msrr_scenes.loading.reference_checks import port_problems, reference_problems, value_problems
from msrr_scenes.specs.scene import Scene


def problems_in(scene: Scene) -> list[Problem]:
    """Return everything that makes a scene unusable although each of its values is allowed.

    Later checks need what earlier ones establish (a unit has to exist before its port can), so the list
    stops with the first stage that finds something.
    """
    problems = [*reference_problems(scene), *value_problems(scene)]
    if problems:
        return problems
    for unit in scene.units:
        try:
            _ = scene.geometry(unit).footprint
        except (GeometryError, SceneError) as error:
            problems.append(Problem(("units", unit, "urdf"), str(error)))
    return problems or port_problems(scene) or geometry_problems(scene)
