"""The result of tuning a controller, and the scene file that holds it."""

from __future__ import annotations

from typing import Any

import yaml
from pydantic import BaseModel

from msrr_bullet.studies.search_space import Part
from msrr_scenes.loading.load import find_scene, load_scene, shipped_scenes
from msrr_scenes.specs.spec import Choice

#: Shipped scene that each part's tuned scene is derived from.
_BASES: dict[Part, str] = {"docking": "close_range", "assembly": "two_units"}


class Tuned(BaseModel, frozen=True, extra="forbid"):
    """The parameters of a controller that tuning found.

    Attributes:
        part: Which of a unit's two controllers it is.
        controller: Registered name of the controller.
        params: Parameters that were found.
        budget: Number of evaluations of the objective.
        cost_shipped: Cost of the controller as it ships, on starts and noise that were not tuned on.
        cost_tuned: Cost of the parameters found, on starts and noise that were not tuned on.
        seeds: First seed and one beyond the last of the starts and noise that were tuned on.
    """

    part: Part
    controller: str
    params: dict[str, Any]
    budget: int
    cost_shipped: float
    cost_tuned: float
    seeds: tuple[int, int]


def tuned_name(part: Part, controller: str) -> str:
    """Return the name of the scene that holds a tuned controller."""
    return f"tuned_{controller}" if part == "docking" else f"tuned_assembly_{controller}"


def tuned_scene(tuned: Tuned) -> str:
    """Return the text of a scene file: a shipped scene under the tuned controller."""
    base = _BASES[tuned.part]
    document = yaml.safe_load(find_scene(base).read_text(encoding="utf-8"))
    document["description"] = f"{base} under {tuned.controller} ({tuned.part}), tuned by `msrr tune`."
    document["control"] = {tuned.part: {"name": tuned.controller, "params": tuned.params}}
    first, stop = tuned.seeds
    head = (
        f"# Written by `msrr tune {tuned.controller} --part {tuned.part}`: {tuned.budget} evaluations\n"
        f"# on unicycles, seeds {first}:{stop}. Cost on other seeds: {tuned.cost_shipped:.3f} as shipped,"
        f" {tuned.cost_tuned:.3f} tuned.\n"
    )
    return head + yaml.safe_dump(document, sort_keys=False, width=100)


def tuned_choice(part: Part, controller: str) -> Choice | None:
    """Return a controller from its shipped tuned scene; None when there is no such scene."""
    name = tuned_name(part, controller)
    if name not in shipped_scenes():
        return None
    control = load_scene(name).control
    return control.docking if part == "docking" else control.assembly
