"""Check of the tags of a port against each other: none covers another one."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.unit_geometry import tag_corners
from msrr_scenes.specs.scene import Scene

#: Overlap of two prints below which they touch [m]; scenes round to 0.1 mm.
_TOUCH_M = 1e-4


def covered_tags(scene: Scene, unit: str) -> Iterator[tuple[str, str]]:
    """Yield tags that cover each other for a camera in front of their port: what is wrong, and one of them.

    A tag is read by its square and the white margin about it, so that no print may reach into the square of
    another one. Families whose outer bits lie around the square need all of their print.
    """
    geometry, family = scene.geometry(unit), scene.tags.tag_family
    if family.name == "tagCustom48h12":
        return  # it has an empty middle, in which another tag may be
    for port in geometry.passive_ports:
        X_PU = geometry.frame(f"port_{port}").inverse()
        prints, needed = dict[str, Array](), dict[str, Array]()
        for slot in geometry.marker_slots(port):
            X_PT, corners = X_PU @ geometry.frame(slot), tag_corners(scene.tag_size(unit, slot))
            prints[slot] = X_PT.act(family.plate_ratio * corners)[:, 1:]
            needed[slot] = prints[slot] if family.white_inside else X_PT.act(corners)[:, 1:]
        for a, b in itertools.combinations(prints, 2):
            overlap = max(_overlap(prints[a], needed[b]), _overlap(needed[a], prints[b]))
            if overlap > _TOUCH_M:
                sizes = " and ".join(f"{1e3 * scene.tag_size(unit, slot):g}" for slot in (a, b))
                yield (
                    f"tags {a} and {b} cover each other by {1e3 * overlap:.1f} mm, seen from in front of "
                    f"port_{port}. Their squares are {sizes} mm wide, and their prints, with the margin "
                    f"without which no square is found, {family.plate_ratio:g} times as wide; move them "
                    "apart, or make them smaller",
                    b,
                )


def _overlap(a: Array, b: Array) -> float:
    """Return the way by which convex polygons, shape (N, 2) [m], would part; below 0 if they are apart."""
    least = np.inf
    for polygon in (a, b):
        along = np.roll(polygon, -1, axis=0) - polygon
        across = along @ np.array([[0.0, -1.0], [1.0, 0.0]]) / np.linalg.norm(along, axis=1, keepdims=True)
        of_a, of_b = a @ across.T, b @ across.T  # a column for each direction
        # One that lies inside the other has to leave it by the nearer side.
        depth = np.minimum(of_a.max(axis=0) - of_b.min(axis=0), of_b.max(axis=0) - of_a.min(axis=0))
        least = min(least, float(depth.min()))
    return least
