"""The interlock of the coordinator: how far every unit may drive."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from msrr_control.coordination.assemblies import is_same_place, standing_bodies
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.shapes.bodies import Body
from msrr_control.tracks.gaps import needed
from msrr_control.tracks.track import Track, standing
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2


class Interlock:
    """Finds how far every unit may drive: the later keeps out of what the earlier still has to drive."""

    def __init__(self, units: Mapping[str, UnitRecord], body: Body) -> None:
        """Bind to the ledger, whose limits are set, with no tracks compared."""
        self._units, self._body = units, body
        self._needed: dict[tuple[str, int, str, int], Array] = {}
        self._clear: dict[tuple[str, int, bool, str, int], NDArray[np.bool_]] = {}

    def needed(self, earlier: UnitRecord, later: UnitRecord) -> Array:
        """Return how far the earlier unit has to be for each sample of the later one's track."""
        assert earlier.track is not None
        assert later.track is not None
        key = (earlier.name, earlier.route, later.name, later.route)
        if key not in self._needed:
            self._needed[key] = needed(self._to_port(earlier), self._to_port(later), self._body)
        return self._needed[key]

    def forget(self, name: str) -> None:
        """Drop what was computed for a unit's earlier routes."""
        self._needed = {key: value for key, value in self._needed.items() if name not in (key[0], key[2])}
        self._clear = {key: value for key, value in self._clear.items() if name not in (key[0], key[3])}

    def extend(self, unit: UnitRecord) -> None:
        """Extend the limit of a unit, which has a track, as far as the others allow; it never shrinks."""
        track = unit.track
        assert track is not None
        free, blocker = track.length, None
        parent_holds = unit.enters is None or self.holds(self._units[unit.enters[0]], unit)
        for other in self._units.values():
            if other.name == unit.name:
                continue
            limit = self._limit_by(other, unit, track)
            if limit < free:
                free, blocker = limit, other.name
        if unit.unlocks and free < track.legs[0].end:
            free = -1.0  # the unit leaves its port only when all of that leg is free
        if unit.enters is not None and free >= track.dock_start and (free < track.length or not parent_holds):
            if free >= track.length:
                blocker = unit.enters[0]
            free = track.dock_start
        unit.limit = max(unit.limit, free)
        unit.blocked_by = blocker if unit.limit < track.length else None

    def holds(self, parent: UnitRecord, unit: UnitRecord) -> bool:
        """Return whether a unit stands, fit to be docked to, with its port where another one's track ends.

        One that was stopped on its way stands elsewhere.
        """
        if unit.enters is None or unit.track is None or parent.under_way or parent.out_of_action:
            return False
        return is_same_place(unit.track.end, self._body.docked(parent.pose, unit.enters[1]))

    def _to_port(self, unit: UnitRecord) -> Track:
        """Return the track of a unit, its end moved to where by now its port is."""
        assert unit.track is not None
        return unit.track if unit.seat is None else unit.track.to_port(unit.seat)

    def _limit_by(self, other: UnitRecord, unit: UnitRecord, track: Track) -> float:
        """Return the limit that another unit imposes [m]."""
        if unit.unlocks and other.holder is not None and other.holder[0] == unit.name:
            return -1.0
        if other.under_way:
            if other.order > unit.order or other.track is None:
                return track.length
            clear = self.needed(other, unit) <= other.passed
        elif other.X_WU is not None and other.still_ns > unit.granted_ns:
            # It stopped where this route was not planned around it.
            if unit.enters is not None and unit.enters[0] == other.name and self.holds(other, unit):
                return track.length
            still = (other.name, other.still_ns, other.may_go_on, unit.name, unit.route)
            if still not in self._clear:
                later = self._to_port(unit)
                bodies = standing_bodies(other, self._units.values())
                each = [needed(standing(body.X_WB, body.at_port), later, self._body) for body in bodies]
                self._clear[still] = np.isneginf(np.max(each, axis=0))
            clear = self._clear[still]
        else:
            return track.length
        count = int(np.count_nonzero(clear))  # the samples that are clear come first
        if count == len(track.s):
            return track.length
        return float(track.s[count - 1]) if count > 0 else -1.0


def clear_of_tracks(X_WU: SE2, unit: UnitRecord, units: Iterable[UnitRecord], body: Body) -> bool:
    """Return whether a unit stands clear of all that others still have to drive."""
    here = standing(X_WU, unit.holder is not None)
    for other in units:
        if other.name == unit.name or not other.under_way or other.track is None:
            continue
        if float(needed(other.track, here, body)[0]) > other.passed:
            return False
    return True
