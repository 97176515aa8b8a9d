"""The recent past of the wheel encoders: angles at any instant, and the way from one instant to another."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from dataclasses import dataclass

from msrr_scenes.messages import NS_PER_S, WheelOdometry

#: How far the last known wheel speeds are trusted beyond the newest reading.
_EXTRAPOLATION_NS = NS_PER_S // 10


@dataclass(frozen=True, slots=True, order=True)
class WheelAngles:
    """Angles turned since power-up [rad] at an instant."""

    stamp_ns: int
    left: float
    right: float


class WheelHistory:
    """Encoder readings in order of their time, whatever the order of their arrival."""

    def __init__(self) -> None:
        self._readings: list[WheelAngles] = []

    def __len__(self) -> int:
        return len(self._readings)

    def add(self, reading: WheelOdometry) -> bool:
        """Store a reading; say whether it is newer than all others. A repeated one is ignored."""
        new = WheelAngles(reading.stamp_ns, reading.left, reading.right)
        if not self._readings or new.stamp_ns > self._readings[-1].stamp_ns:
            self._readings.append(new)
            return True
        i = self._index(new.stamp_ns)
        if self._readings[i].stamp_ns != new.stamp_ns:
            insort(self._readings, new)
        return False

    def forget_before(self, stamp_ns: int) -> None:
        """Drop readings that are not needed for instants from ``stamp_ns`` on."""
        keep = max(bisect_right(self._readings, stamp_ns, key=lambda r: r.stamp_ns) - 1, 0)
        del self._readings[:keep]

    def at(self, stamp_ns: int) -> WheelAngles | None:
        """Return the angles at an instant; None before any reading is known.

        Between readings the speeds are constant; after the newest one they stay as they were for 0.1 s and
        are zero from then on; before the oldest one the wheels stand.
        """
        readings = self._readings
        if not readings:
            return None
        i = self._index(stamp_ns)
        if i < len(readings) and readings[i].stamp_ns == stamp_ns:
            return readings[i]
        if i == 0:
            return WheelAngles(stamp_ns, readings[0].left, readings[0].right)
        if i == len(readings):
            return self._after_newest(stamp_ns)
        return _between(readings[i - 1], readings[i], stamp_ns, stamp_ns)

    def way(self, after_ns: int, until_ns: int) -> list[WheelAngles]:
        """Return the readings strictly between two instants, then the angles at ``until_ns``."""
        end = self.at(until_ns)
        if end is None:
            return []
        return [*self._readings[self._index(after_ns + 1) : self._index(until_ns)], end]

    def newest_until(self, stamp_ns: int) -> int | None:
        """Return the time of the newest reading not after ``stamp_ns``."""
        i = self._index(stamp_ns + 1)
        return self._readings[i - 1].stamp_ns if i else None

    def _after_newest(self, stamp_ns: int) -> WheelAngles:
        newest = self._readings[-1]
        if len(self._readings) < 2:
            return WheelAngles(stamp_ns, newest.left, newest.right)
        until = min(stamp_ns, newest.stamp_ns + _EXTRAPOLATION_NS)
        return _between(self._readings[-2], newest, until, stamp_ns)

    def _index(self, stamp_ns: int) -> int:
        return bisect_left(self._readings, stamp_ns, key=lambda r: r.stamp_ns)


def _between(a: WheelAngles, b: WheelAngles, at_ns: int, stamp_ns: int) -> WheelAngles:
    """Return the angles on the line through ``a`` and ``b`` at ``at_ns``, stamped ``stamp_ns``."""
    k = (at_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
    return WheelAngles(stamp_ns, a.left + k * (b.left - a.left), a.right + k * (b.right - a.right))
