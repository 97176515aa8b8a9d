"""All checks of a scene: what makes it unusable although each of its values is allowed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from msrr_scenes.checks.as_built import as_built_problems
from msrr_scenes.checks.cameras import camera_problems
from msrr_scenes.checks.markers import marker_problems, unit_problem
from msrr_scenes.checks.mechanism import mechanism_problems
from msrr_scenes.checks.moves import taken_ends
from msrr_scenes.checks.plan import fault_problems, idle_faults, mission_problems, plan_problems
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
    *("exposure_ms", "rolling_shutter_ms", "renderer"),
    *("readout", "localisation", "samples"),
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
    problems = problems or [*mechanism_problems(scene), *idle_faults(scene)]
    return problems or [*start_problems(scene), *taken_ends(scene)]


def overrides_without_effect(scene: Scene, overrides: Iterable[str]) -> Iterator[Problem]:
    """Yield the overrides that change nothing: a study of such a value would find that it does not matter.

    What a file says is left alone, for it may be run with another perception, plant or camera.
    """
    unused = [(key, why) for keys, why in _without_effect(scene) for key in keys]
    for override in overrides:
        why = next((why for key, why in unused if f"{override}.".startswith(f"{key}.")), None)
        if why is not None:
            yield Problem(tuple(override.split(".")), f"changes nothing {why}, or leave it out")


def _without_effect(scene: Scene) -> Iterator[tuple[list[str], str]]:
    """Yield the keys that change nothing in a scene, with why, and what has to be set as well."""
    if scene.perception == "images":
        yield ["parametric"], "with perception: images; set perception=parametric as well"
    else:
        text = "with perception: parametric, which has no pixels; set parametric.sigma_xy_m and the like"
        of_cameras = [f"cameras.{camera}.{key}" for camera in ("onboard", "overhead") for key in _OF_PIXELS]
        yield [*of_cameras, "control.detector"], f"{text}, or perception=images"
    if scene.plant == "unicycle":
        yield ["motors", "lock.pull_time_s"], "with plant: unicycle, which has no forces; set plant=bullet"
    if scene.cameras.overhead is None:
        keys = ["assembly", "guard", "overhead_correction"]
        yield [f"control.{key}" for key in keys], "without an overhead camera; set cameras.overhead={}"
    if not scene.coordinated:
        yield ["one_by_one", "docking.learn_seats"], "without a base station; set radio={}"
    if not scene.docks and scene.shape is None:
        of_attempts = ["attempts", "search_time_s", "stall_time_s", "press_mps"]
        keys = ["control.docking", *(f"docking.{key}" for key in of_attempts)]
        yield keys, "in a plan in which no unit docks; give it a step that docks"
    text = "but the time that a trial takes, for robots read windows of it; set cameras.onboard.readout"
    yield ["cameras.overhead.readout"], text
    for name, camera in scene.cameras:
        if camera is None:
            continue
        key = f"cameras.{name}"
        if camera.calibration is not None:
            yield [f"{key}.hfov_deg"], "beside a calibration, which says what the camera sees; take that out"
        if camera.renderer.name == "raster":
            yield [f"{key}.samples"], f"with the renderer raster, which needs none; set {key}.renderer=tiny"
