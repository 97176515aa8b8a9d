"""The routes that a base station has granted to units, as lines on the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_control.tracks.track import track_of
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import Authority
from msrr_scenes.specs.scene import Scene


@dataclass(frozen=True, eq=False)
class RouteLine:
    """The way of a unit's axle along a route.

    Attributes:
        s: Arc length of each sample, not descending, shape (N,) [m]; that of a turn counts too.
        points: Position of the axle at each sample in W, shape (N, 2) [m].
    """

    s: Array
    points: Array

    @property
    def length(self) -> float:
        """Arc length of the whole route [m]."""
        return float(self.s[-1])

    def part(self, low: float, high: float) -> Array:
        """Return the points between two arc lengths [m], shape (K, 2) [m]; K is 0 for an empty range."""
        if high <= low:
            return np.empty((0, 2))
        inside = (self.s > low) & (self.s < high)
        s = np.concatenate([[low], self.s[inside], [high]])
        return np.column_stack([np.interp(s, self.s, self.points[:, k]) for k in range(2)])


class Routes:
    """The routes of one mission. Each is computed once, however often its authority is repeated."""

    def __init__(self, scene: Scene) -> None:
        """Begin without a route."""
        geometries = {name: scene.geometry(name) for name in scene.units}
        self._offset = {n: unit.control_offset(ACTIVE_PORT) for n, unit in geometries.items() if unit.drives}
        self._known: dict[tuple[str, int], RouteLine] = {}

    def of(self, authority: Authority) -> RouteLine:
        """Return the route of an authority; of no length where the unit stands already where it is to be."""
        key = authority.unit, authority.route
        if not authority.legs:
            return RouteLine(np.zeros(1), np.zeros((1, 2)))
        if key not in self._known:
            start = SE2(*authority.legs[0].start)
            track = track_of(authority.legs, start, self._offset[authority.unit])
            self._known[key] = RouteLine(track.s, track.poses[:, :2])
        return self._known[key]
