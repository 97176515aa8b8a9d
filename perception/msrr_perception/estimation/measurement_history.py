"""Measurements in the order of their exposures, whatever the order of arrival, and the state after each."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from msrr_perception.motion.filter_state import FilterState
from msrr_scenes.messages import Detections, PoseMeasurement

Measurement = Detections | PoseMeasurement

#: Returns the state after a measurement from the state before it: both None before the filter has started.
Process = Callable[[FilterState | None, Measurement], FilterState | None]


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """A measurement and the state after it; None before the filter has started.

    The measurements are ordered by ``key``: time of exposure, frame number, camera.
    """

    key: tuple[int, int, str]
    measurement: Measurement
    after: FilterState | None

    @property
    def wheels_until_ns(self) -> int:
        """Time until which the state rests on what the wheels did [ns]."""
        return self.key[0] if self.after is None else max(self.key[0], self.after.wheels_until_ns)


class MeasurementHistory:
    """The measurements that still count, each with the state after it.

    A measurement that arrives late is inserted at its time, and those after it are processed again, so that
    the result is that of ordered measurements, bit for bit. Nothing is processed again before a state is
    asked for: wheels are read more often.
    """

    def __init__(self, process: Process, horizon_ns: int) -> None:
        """Begin without measurements.

        Args:
            process: Computes the state after a measurement.
            horizon_ns: Largest time by which a measurement may be older than the newest one [ns].
        """
        self._process, self._horizon_ns = process, horizon_ns
        self._entries: list[_Entry] = []
        self._valid = 0  # number of entries that no reading of the wheels has come for since

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest measurement [ns]; None without one."""
        return self._entries[-1].key[0] if self._entries else None

    @property
    def newest(self) -> FilterState | None:
        """State after the newest measurement; None before the filter has started."""
        entries = self._processed()
        return entries[-1].after if entries else None

    @property
    def needed_from_ns(self) -> int:
        """Time from which on a measurement may be processed again [ns]; there has to be a measurement."""
        return min(self._entries[0].key[0], self._oldest_ns)

    @property
    def _oldest_ns(self) -> int:
        """Time before which no measurement counts any more [ns]."""
        return self._entries[-1].key[0] - self._horizon_ns

    def state_before(self, stamp_ns: int) -> FilterState | None:
        """Return the state after the last measurement up to an instant; None where there is none."""
        for entry in reversed(self._processed()):
            if entry.key[0] <= stamp_ns:
                return entry.after
        return None

    def insert(self, measurement: Measurement) -> bool:
        """Insert a measurement; return False if it is too old to count, or was delivered before."""
        key = _key(measurement)
        i = bisect_left(self._entries, key, key=lambda e: e.key)
        if i < len(self._entries) and self._entries[i].key == key:
            return False
        if i == 0 and self._entries and key[0] < self._oldest_ns:
            return False
        later = [measurement, *(e.measurement for e in self._entries[i:])]
        valid = min(self._valid, i)
        self._process_from(valid, [*(e.measurement for e in self._entries[valid:i]), *later])
        forgotten = self._forgotten()
        del self._entries[:forgotten]
        self._valid -= forgotten
        return True

    def invalidate(self, after_ns: int | None, about_ns: int) -> bool:
        """Have what rests on the wheels after an instant, and all newer measurements, processed again.

        The first one whose predecessors are forgotten stays as it is. ``after_ns`` is None for all that
        count, and ``about_ns`` the largest time after a measurement on which it may rest.

        Returns:
            Whether there is such a measurement.
        """
        first = 0
        if after_ns is not None:
            if self._entries[-1].key[0] <= after_ns - about_ns:  # nearly always: readings come at once
                return False
            first = len(self._entries)
            while first > 0 and self._entries[first - 1].key[0] > after_ns - about_ns:  # few are that new
                first -= 1
            while first < len(self._entries) and self._entries[first].wheels_until_ns <= after_ns:
                first += 1
        if self._entries[0].key[0] < self._oldest_ns:
            first = max(first, 1)
        self._valid = min(self._valid, first)
        return first < len(self._entries)

    def _processed(self) -> list[_Entry]:
        """Return all entries, after those that are not valid have been processed again."""
        if self._valid < len(self._entries):
            self._process_from(self._valid, [e.measurement for e in self._entries[self._valid :]])
        return self._entries

    def _forgotten(self) -> int:
        """Return the number of measurements that no other one is processed from any more."""
        return max(bisect_left(self._entries, self._oldest_ns, key=lambda e: e.key[0]) - 1, 0)

    def _process_from(self, i: int, measurements: Iterable[Measurement]) -> None:
        """Process measurements behind the first ``i`` entries, in place of the entries that were there."""
        del self._entries[i:]
        state = self._entries[-1].after if self._entries else None
        for m in measurements:
            state = self._process(state, m)
            self._entries.append(_Entry(_key(m), m, state))
        self._valid = len(self._entries)


def _key(measurement: Measurement) -> tuple[int, int, str]:
    exposure = measurement.exposure
    return exposure.stamp_ns, exposure.frame, exposure.camera
