"""The routes that a base station has granted to units, as lines on the floor."""

from __future__ import annotations

import numpy as np

from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_control.tracks.track import Track, standing, track_of
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import Authority
from msrr_scenes.specs.scene import Scene


class Routes:
    """The routes of one mission. Each is computed once, however often its authority is repeated."""

    def __init__(self, scene: Scene) -> None:
        """Begin without a route."""
        geometries = {name: scene.geometry(name) for name in scene.units}
        self._offset = {n: unit.control_offset(ACTIVE_PORT) for n, unit in geometries.items() if unit.drives}
        self._known: dict[tuple[str, int], Track] = {}

    def of(self, authority: Authority) -> Track:
        """Return the route of an authority; of no length where the unit stands already where it is to be."""
        key = authority.unit, authority.route
        if not authority.legs:
            return standing(SE2())
        if key not in self._known:
            start = SE2(*authority.legs[0].start)
            self._known[key] = track_of(authority.legs, start, self._offset[authority.unit])
        return self._known[key]


def part_of(route: Track, low: float, high: float) -> Array:
    """Return the way of the axle between two arc lengths [m], shape (K, 2) [m]; K is 0 for an empty range."""
    if high <= low:
        return np.empty((0, 2))
    inside = (route.s > low) & (route.s < high)
    s = np.concatenate([[low], route.s[inside], [high]])
    return np.column_stack([np.interp(s, route.s, route.poses[:, k]) for k in range(2)])
