"""Checks of markers that were measured: the map has all of their tags, in the scene's family and sizes."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msrr_scenes.errors import MsrrError, nearest
from msrr_scenes.geometry.unit_geometry import marker_links
from msrr_scenes.loading.problems import Problem
from msrr_scenes.specs.scene import Scene

#: Largest difference of two sizes of tags that mean the same one, relative: files round.
_SAME_SIZE = 1e-4


def marker_problems(scene: Scene) -> list[Problem]:
    """Return what contradicts the maps of markers."""
    return [problem for unit in scene.units for problem in _of_unit(scene, unit)]


def _of_unit(scene: Scene, unit: str) -> Iterator[Problem]:
    if not scene.units[unit].markers:
        return
    try:
        ids = scene.tag_ids(unit)
    except MsrrError as error:
        yield Problem(("units", unit, "urdf"), str(error))
        return
    for port, marker in scene.units[unit].markers.items():
        path = ("units", unit, "markers", port)
        slots, found = marker_links(port), marker.map
        if not ids.keys() >= set(slots):
            ports = [slot.split("_")[1] for slot in ids if slot.endswith("_marker_middle")]
            text = f"no port with a marker{nearest(port, ports)} Ports with one: {', '.join(ports)}"
            yield Problem(path, text)
            continue
        missing = [
            f"{ids[slot]} ({slot.rpartition('_')[2]})" for slot in slots if ids[slot] not in found.tags
        ]
        if missing:
            text = f"the map has no tag {', '.join(missing)}; it has {', '.join(map(str, found.tags))}"
            yield Problem((*path, "map"), text)
        if found.family != scene.tags.family:
            text = f"the map is of {found.family} tags, and those of this scene are {scene.tags.family}"
            yield Problem((*path, "map"), text)
        for key, slot in (("side_m", slots[0]), ("mast_m", slots[1])):
            size = scene.tag_size(slot)
            if not math.isclose(size, found.tag_size_m, rel_tol=_SAME_SIZE):
                text = (
                    f"the map is of tags of {found.tag_size_m:g} m, and tags.{key} = {size:g}; set that, or "
                    "map the tags with the size that they have"
                )
                yield Problem((*path, "map"), text)
