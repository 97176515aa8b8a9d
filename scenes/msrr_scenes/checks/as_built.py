"""Checks of what is not as designed: a true error that is given has to have an effect in the trial."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_scenes.checks.problems import Problem
from msrr_scenes.specs.scene import Scene


def as_built_problems(scene: Scene) -> Iterator[Problem]:
    """Yield true errors that nothing in the scene would show.

    The standard deviations of a grade are no such errors: what the scene does not have is not drawn.
    """
    for group, quantity, deviation in scene.as_built.deviations():
        if not deviation.error:
            continue
        why = without_effect(scene, group, quantity)
        if why:
            yield Problem(("as_built", group, quantity), why)


def without_effect(scene: Scene, group: str, quantity: str) -> str | None:
    """Return why an error of this quantity would change nothing in the scene; None if it acts."""
    if (group == "floor" or quantity == "mass_percent") and scene.plant != "bullet":
        return f"the plant {scene.plant!r} has no floor and no masses; use plant bullet, or leave it out"
    if group == "overhead" and scene.cameras.overhead is None:
        return "this scene has no overhead camera; give one under cameras.overhead, or leave it out"
    return None
