"""The effects of a tolerance study: every quantity that can differ from the drawing, one at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from pydantic import ValidationError

from msrr_bullet.tolerance.camera_response import RESPONSES, with_response
from msrr_scenes.checks.as_built import without_effect
from msrr_scenes.errors import MsrrError, SceneError, UnknownNameError
from msrr_scenes.loading.load import check_scene
from msrr_scenes.specs.as_built import CAREFUL, AsBuiltSpec
from msrr_scenes.specs.deviations import Deviation, FrictionDeviation
from msrr_scenes.specs.field_descriptions import field_descriptions
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Spec

#: Largest size of an effect over one standard deviation of the grade ``careful``: four of ``rough``.
RANGE = 16.0

#: Largest size that is tried over the largest one that the scene accepts: the check of a lens looks at every
#: eighth pixel of the frame, its drawing at every one.
_INSIDE = 0.95

#: Size of an error that is too small to matter, in standard deviations of the grade ``careful``.
_NEGLIGIBLE = 1e-3

#: Sizes by which effects are compared that no grade has, in the units of their keys.
_COMPARED = {
    **dict.fromkeys(("k2", "k3"), 0.01),
    **dict.fromkeys(("p1", "p2"), 0.001),
    "jitter_ms": 10.0,
    "dead_zone_radps": 0.05,
    "mass_percent": 5.0,
    "switch_travel_m": 0.0002,
    "ridge_m": 0.0005,
}

#: Unit in which a quantity is shown, with the factor to it, by the last part of its key.
_UNITS = {
    "m": ("mm", 1000.0),
    "deg": ("deg", 1.0),
    "percent": ("%", 1.0),
    "px": ("px", 1.0),
    "ms": ("ms", 1.0),
    "radps": ("rad/s", 1.0),
}


@dataclass(frozen=True, slots=True)
class Effect:
    """One quantity that differs from the drawing.

    Attributes:
        name: Key of the quantity below ``as_built``, or below the scene for the response of a camera.
        description: What the quantity is.
        unit: Unit in which sizes are shown.
        scale: Shown size over a size in the unit of the key.
        step: Size by which effects are compared: one standard deviation of ``careful`` if ``graded``.
        graded: Whether the grades have this effect.
        signs: Signs of the errors that are tried.
        drawn: Whether the size is a standard deviation, with which every tag has an error of its own.
        top: Largest size.
        apply: Returns a scene with an error, in the unit of the key.
    """

    name: str
    description: str
    unit: str
    scale: float
    step: float
    graded: bool
    signs: tuple[float, ...]
    drawn: bool
    top: float
    apply: Callable[[Scene, float], Scene]


def as_designed_scene(scene: Scene) -> Scene:
    """Return the scene with its tolerances, which the robots know, and without any true error.

    Its cameras have the optics of perfect calibration where they have those of a grade: each effect is alone.
    The encoders are those of the scene: under a grade they err as the wheels do, and by nothing of their own.
    """
    groups: dict[str, dict[str, Deviation]] = {}
    for group, quantity, deviation in scene.as_built.deviations():
        if deviation.sigma or deviation.error:
            groups.setdefault(group, {})[quantity] = deviation.model_copy(update={"error": 0.0})
    updates = {
        group: getattr(scene.as_built, group).model_copy(update=zero) for group, zero in groups.items()
    }
    as_built = scene.as_built.model_copy(update=updates)
    return scene.at_grade("perfect").model_copy(update={"as_built": as_built, "odometry": scene.odometry})


def nearly_the_same(scene: Scene) -> Scene:
    """Return a scene with an error that is too small to matter: whatever it changes in a trial is chance.

    The course of a trial depends on each pixel, and with that on each error.
    """
    size = _NEGLIGIBLE * CAREFUL["drive"]["radius_left_percent"]
    return _deviated(scene, size, group="drive", quantity="radius_left_percent", drawn=False)


def effects_of(scene: Scene) -> tuple[Effect, ...]:
    """Return every effect that acts in a scene, each with the largest size that the scene accepts."""
    base = as_designed_scene(scene)
    found = [*_deviations(base), *_responses(base)]
    return tuple(replace(effect, top=_largest_accepted(base, effect)) for effect in found)


def select_effects(effects: Sequence[Effect], names: Sequence[str]) -> tuple[Effect, ...]:
    """Return the effects of these names; a name may be that of a group, such as ``drive`` or ``cameras``.

    Raises:
        UnknownNameError: No effect and no group of effects has a name.
    """
    known = {effect.name: effect for effect in effects}
    groups = {parent for name in known for parent in _parents(name)}
    chosen: dict[str, Effect] = {}
    for name in names:
        if name not in known and name not in groups:
            hint = "What does not act in this scene, as a camera without pixels, is no effect."
            raise UnknownNameError("effect", name, [*groups, *known], hint)
        chosen |= {key: effect for key, effect in known.items() if name in (key, *_parents(key))}
    return tuple(effect for effect in effects if effect.name in chosen)


def _parents(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:i]) for i in range(1, len(parts))]


def _deviations(scene: Scene) -> Iterator[Effect]:
    for group, quantity, deviation in scene.as_built.deviations():
        if without_effect(scene, group, quantity):
            continue
        unit, scale = _UNITS.get(quantity.rpartition("_")[2], ("", 1.0))
        sigma = CAREFUL.get(group, {}).get(quantity)
        drawn = group == "tags" and quantity != "print_percent"
        yield Effect(
            name=f"{group}.{quantity}",
            description=_description(group, quantity),
            unit=unit,
            scale=scale,
            step=_COMPARED[quantity] if sigma is None else sigma,
            graded=sigma is not None,
            signs=(1.0,) if drawn or deviation.one_sided else (1.0, -1.0),
            drawn=drawn,
            top=0.0,
            apply=partial(_deviated, group=group, quantity=quantity, drawn=drawn),
        )


def _description(group: str, quantity: str) -> str:
    """Return what a quantity is, from the docstrings of the specification."""
    drawing: Spec = getattr(AsBuiltSpec(), group)
    whole = field_descriptions(AsBuiltSpec)[group]
    part = field_descriptions(type(drawing))[quantity]
    said = part[:1].lower() + part[1:].partition("[")[0].rstrip(" .")
    if isinstance(getattr(drawing, quantity), FrictionDeviation):
        said += ", lower by the factor exp(-x / 100)"
    return f"{whole.partition('.')[0].partition(',')[0]}: {said}"


def _responses(scene: Scene) -> Iterator[Effect]:
    if scene.perception != "images":
        return
    for camera in ("onboard", "overhead"):
        if getattr(scene.cameras, camera) is None:
            continue
        for key, response in RESPONSES.items():
            yield Effect(
                name=f"cameras.{camera}.{key}",
                description=f"{camera} camera: {response.description}",
                unit=response.unit,
                scale=1.0,
                step=response.step,
                graded=False,
                signs=response.signs,
                drawn=False,
                top=0.0,
                apply=partial(with_response, camera=camera, key=key),
            )


def _deviated(scene: Scene, error: float, *, group: str, quantity: str, drawn: bool) -> Scene:
    """Give a quantity of ``as_built`` an error, or, if it is drawn, a standard deviation."""
    spec = getattr(scene.as_built, group)
    deviation = getattr(spec, quantity)
    if drawn:
        values = {"sigma": error, "error": None}
    elif isinstance(deviation, FrictionDeviation):
        values = {"sigma": deviation.sigma, "error": 100.0 * math.expm1(-error / 100.0)}
    else:
        values = {"sigma": deviation.sigma, "error": error}
    built = spec.model_copy(update={quantity: type(deviation).model_validate(values)})
    return scene.model_copy(update={"as_built": scene.as_built.model_copy(update={group: built})})


def _largest_accepted(scene: Scene, effect: Effect) -> float:
    """Return the largest size in the range of an effect whose errors, of every sign, the scene accepts."""

    def accepted(size: float) -> bool:
        try:
            for sign in effect.signs:
                check_scene(effect.apply(scene, sign * size))
        except (ValidationError, SceneError):
            return False
        return True

    low, high = 0.0, RANGE * effect.step
    if accepted(high):
        return high
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if accepted(middle) else (low, middle)
    if low == 0.0:
        raise MsrrError(
            f"{scene.name}: the scene accepts no error of {effect.name}; leave it out by --effects"
        )
    return _INSIDE * low
