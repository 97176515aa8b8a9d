"""Checks of markers that were measured: the map has all of their tags, in the scene's family."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msrr_scenes.checks.problems import KeyPath, Problem
from msrr_scenes.errors import MsrrError, nearest
from msrr_scenes.geometry.frame_map import FrameMapError
from msrr_scenes.specs.bodies import MarkerSpec
from msrr_scenes.specs.scene import Scene


def marker_problems(scene: Scene) -> list[Problem]:
    """Return what contradicts the maps of markers."""
    return [problem for unit in scene.units for problem in _of_unit(scene, unit)]


def _of_unit(scene: Scene, unit: str) -> Iterator[Problem]:
    if not scene.units[unit].markers:
        return
    try:
        ids = scene.tag_ids(unit)
    except MsrrError as error:
        yield unit_problem(unit, error)
        return
    for port, marker in scene.units[unit].markers.items():
        path = ("units", unit, "markers", port)
        if marker.map.family != scene.tags.family:
            text = f"the map is of {marker.map.family} tags, and those of this scene are {scene.tags.family}"
            yield Problem((*path, "map"), text)
        slots = [slot for slot in ids if slot.startswith(f"port_{port}_marker_")]
        if marker.dock is not None:
            drawn = sorted(set(slots) - scene.units[unit].mapped_tag_ids().keys())
            if drawn:
                text = f"the URDF has tags of this port, {', '.join(drawn)}; say anchor instead"
                yield Problem((*path, "dock"), text)
            if marker.anchor != type(marker).model_fields["anchor"].default:
                text = "changes nothing beside dock, which says where all tags of the map are; leave it out"
                yield Problem((*path, "anchor"), text)
            continue
        if not slots:
            ports = [slot.split("_")[1] for slot in ids if "_marker_" in slot]
            known = ", ".join(dict.fromkeys(ports))
            text = (
                f"no port with a marker{nearest(port, ports)} Ports with one: {known}. "
                "For a port without tags in the URDF, say by the key dock where the map is"
            )
            yield Problem(path, text)
            continue
        yield from _not_anchored(path, slots, ids, marker)


def _not_anchored(
    path: KeyPath, slots: Sequence[str], ids: Mapping[str, int], marker: MarkerSpec
) -> Iterator[Problem]:
    names = {slot: slot.split("_", 3)[3] for slot in slots}
    if marker.anchor not in names.values():
        known = names.values()
        text = (
            f"no tag {marker.anchor!r} of this port{nearest(marker.anchor, known)} Tags: {', '.join(known)}"
        )
        yield Problem((*path, "anchor"), text)
    missing = [f"{ids[slot]} ({names[slot]})" for slot in slots if ids[slot] not in marker.map.tags]
    if missing:
        text = f"the map has no tag {', '.join(missing)}; it has {', '.join(map(str, marker.map.tags))}"
        yield Problem((*path, "map"), text)


def unit_problem(unit: str, error: MsrrError) -> Problem:
    """Return the reason why the geometry of a unit cannot be had, at the key that is at fault."""
    if isinstance(error, FrameMapError):
        return Problem(("units", unit, "frames", error.frame), str(error))
    return Problem(("units", unit, "urdf"), str(error))
