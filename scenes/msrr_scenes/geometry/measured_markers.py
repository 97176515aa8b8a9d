"""Markers of a unit where they were measured, and not where its URDF draws them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry

#: A tag of a map: its link, its place [m] and its rotation.
_MappedTag = tuple[str, tuple[float, ...], tuple[float, ...]]


@lru_cache(maxsize=32)
def with_markers(
    drawn: UnitGeometry, markers: tuple[tuple[str, tuple[_MappedTag, ...]], ...]
) -> UnitGeometry:
    """Return a geometry with measured markers in the place of those that its URDF draws.

    ``markers`` has for each of them the link that anchors its map, and the tags of that map.
    """
    frames = dict[str, SE3]()
    for anchor, tags in markers:
        X_MT = {slot: SE3.from_quaternion_xyzw(p, xyzw) for slot, p, xyzw in tags}
        X_UM = drawn.frame(anchor) @ X_MT[anchor].inverse()
        frames |= {slot: drawn.frame(slot) if slot == anchor else X_UM @ X for slot, X in X_MT.items()}
    return replace(drawn, frames={**drawn.frames, **frames})
