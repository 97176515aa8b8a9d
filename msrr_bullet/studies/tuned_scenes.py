"""Scene files that hold what tuning found."""

from __future__ import annotations

import yaml

from msrr_bullet.studies.search_space import Part
from msrr_bullet.studies.tuning import Tuned
from msrr_scenes.loading.load import find_scene, load_scene, shipped_scenes
from msrr_scenes.specs.spec import Choice

#: Shipped scene under which each part is tuned and shown.
_BASES: dict[Part, str] = {"docking": "close_range", "assembly": "two_units"}


def tuned_name(part: Part, controller: str) -> str:
    """Return the name of the scene that holds what tuning found."""
    return f"tuned_{controller}" if part == "docking" else f"tuned_assembly_{controller}"


def tuned_scene(tuned: Tuned) -> str:
    """Return the text of a scene file: a shipped scene under the tuned controller."""
    base = _BASES[tuned.part]
    document = yaml.safe_load(find_scene(base).read_text(encoding="utf-8"))
    what = f"{tuned.controller} ({tuned.part})"
    document["description"] = f"{base} under {what}, tuned by `msrr tune`."
    document["control"] = {tuned.part: {"name": tuned.controller, "params": tuned.params}}
    first, stop = tuned.seeds
    head = (
        f"# Written by `msrr tune {tuned.controller} --part {tuned.part}`: {tuned.budget} evaluations\n"
        f"# on unicycles, seeds {first}:{stop}. Cost on other seeds: {tuned.cost_shipped:.3f} as shipped,"
        f" {tuned.cost_tuned:.3f} tuned.\n"
    )
    return head + yaml.safe_dump(document, sort_keys=False, width=100)


def tuned_choice(part: Part, controller: str) -> Choice | None:
    """Return a controller as its shipped tuned scene has it; None when there is no such scene."""
    name = tuned_name(part, controller)
    if name not in shipped_scenes():
        return None
    control = load_scene(name).control
    return control.docking if part == "docking" else control.assembly
