"""All checks of a scene: what makes it unusable although each of its values is allowed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msrr_scenes.checks.as_built import as_built_problems
from msrr_scenes.checks.cameras import camera_problems
from msrr_scenes.checks.markers import marker_problems, unit_problem
from msrr_scenes.checks.mechanism import mechanism_problems
from msrr_scenes.checks.moves import taken_ends
from msrr_scenes.checks.plan import fault_problems, mission_problems, plan_problems
from msrr_scenes.checks.problems import Problem
from msrr_scenes.checks.references import port_problems, reference_problems, value_problems
from msrr_scenes.checks.robot import robot_problems
from msrr_scenes.checks.starts import start_problems
from msrr_scenes.errors import GeometryError, SceneError
from msrr_scenes.specs.scene import Scene

#: Keys of a camera that act on rendered images, or on what is found in them, alone.
_OF_PIXELS = {
    *("noise_grey", "shot_grey", "blur_px", "gain", "gamma", "vignetting"),
    *("light_gradient", "light_gradient_deg", "jpeg_quality"),
    *("readout", "localisation"),
}


def contradictions(scene: Scene) -> list[Problem]:
    """Return everything that makes a scene unusable although each of its values is allowed.

    Later checks need what earlier ones establish (a unit has to exist before its port can), so the list
    ends with the first stage that finds something.
    """
    problems = marker_problems(scene)
    if problems:
        return problems
    problems = [
        *reference_problems(scene),
        *value_problems(scene),
        *as_built_problems(scene),
        *camera_problems(scene),
        *fault_problems(scene),
        *mission_problems(scene),
    ]
    if problems:
        return problems
    for unit in scene.units:
        try:
            geometry = scene.geometry(unit)
            _ = geometry.footprint
            if not geometry.drives:
                text = f"{geometry.urdf}: a fixture, for target files alone; a unit has wheels"
                problems.append(Problem(("units", unit, "urdf"), text))
        except (GeometryError, SceneError) as error:
            problems.append(unit_problem(unit, error))
    problems = problems or [*port_problems(scene), *plan_problems(scene)]
    problems = problems or [problem for unit in scene.units for problem in robot_problems(scene, unit)]
    problems = problems or [*mechanism_problems(scene)]
    return problems or [*start_problems(scene), *taken_ends(scene)]


def overrides_without_effect(scene: Scene, overrides: Iterable[str]) -> Iterator[Problem]:
    """Yield the overrides that change nothing: a study of such a value would find that it does not matter.

    What a file says is left alone, for it may be run with either kind of perception.
    """
    for key in overrides:
        first, second, third = (*key.split("."), "", "")[:3]
        of_pixels = (first == "cameras" and third in _OF_PIXELS) or (first, second) == ("control", "detector")
        if scene.perception == "images" and key.startswith("parametric."):
            text = (
                "changes nothing with perception: images; set perception=parametric as well, or leave it out"
            )
            yield Problem(tuple(key.split(".")), text)
        elif scene.perception == "parametric" and of_pixels:
            text = (
                "changes nothing with perception: parametric, which has no pixels; set parametric.sigma_xy_m "
                "and the like, or perception=images"
            )
            yield Problem(tuple(key.split(".")), text)
