"""The recent wheel encoder readings, interpolated: angles at any instant and between two instants."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import NamedTuple

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.messages import NS_PER_S, WheelOdometry, seconds

#: Shortest time beyond the newest reading for which the last wheel speeds are assumed to last [ns]. Where
#: readings are rarer than that, they last until the next one is due.
_EXTRAPOLATION_NS = NS_PER_S // 10

#: Time between two readings above which the encoders were silent, as those of a unit on standby are [ns].
#: The slowest ones read once a second.
_SILENT_NS = 3 * NS_PER_S // 2

#: Time between readings, and after the newest one, within which an acceleration changes the way by no more
#: than the rounding of an encoder does [ns]: 20 um at 0.2 m/s^2.
_DENSE_NS = 15 * NS_PER_S // 1000


class WheelAngles(NamedTuple):
    """The angles that the wheels have turned since power-up [rad], at an instant.

    ``since_left`` and ``since_right`` say by how much each has turned since it last began to turn the other
    way [rad]: first the play of its gear is taken up, and only then the wheel follows.
    """

    stamp_ns: int
    left: float
    right: float
    since_left: float = 0.0
    since_right: float = 0.0


#: Last angles other than zero by which the left and the right motor turned between two readings [rad].
_Ways = tuple[float, float]


class WheelHistory:
    """Encoder readings in the order of their time stamps, whatever the order of arrival."""

    def __init__(self) -> None:
        self._readings: list[WheelAngles] = []
        self._stamps: list[int] = []  # of the readings
        self._ways: list[_Ways] = []  # of the readings

    def add(self, reading: WheelOdometry) -> bool:
        """Store a reading and return whether it is newer than all others. A repeated one is ignored."""
        stamp_ns = reading.stamp_ns
        if not self._stamps or stamp_ns > self._stamps[-1]:
            self._stamps.append(stamp_ns)
            self._append(reading)
            return True
        i = bisect_left(self._stamps, stamp_ns)
        later = self._readings[i:]
        if later[0].stamp_ns == stamp_ns:
            return False
        self._stamps.insert(i, stamp_ns)
        if i == 0 and self._ways[0] != (0.0, 0.0):  # what is known from readings that are forgotten stays
            first = later[0]
            new = WheelAngles(stamp_ns, reading.left, reading.right, first.since_left, first.since_right)
            self._readings.insert(0, new)
            self._ways.insert(0, self._ways[0])
        else:
            del self._readings[i:], self._ways[i:]
            self._append(reading)
            for angles in later:
                self._append(angles)
        return False

    def _append(self, new: WheelOdometry | WheelAngles) -> None:
        """Append the newest angles, with those since both wheels began to turn the way they do."""
        if not self._readings:
            self._readings.append(WheelAngles(new.stamp_ns, new.left, new.right))
            self._ways.append((0.0, 0.0))
            return
        last, (way_left, way_right) = self._readings[-1], self._ways[-1]
        since_left, way_left = _counted(new.left - last.left, last.since_left, way_left)
        since_right, way_right = _counted(new.right - last.right, last.since_right, way_right)
        self._readings.append(WheelAngles(new.stamp_ns, new.left, new.right, since_left, since_right))
        self._ways.append((way_left, way_right))

    def forget_before(self, stamp_ns: int) -> None:
        """Drop readings that are not needed for instants from ``stamp_ns`` on."""
        keep = max(bisect_right(self._stamps, stamp_ns) - 1, 0)
        del self._readings[:keep], self._stamps[:keep], self._ways[:keep]

    def angles_at(self, stamp_ns: int) -> WheelAngles | None:
        """Return the angles at an instant; None before any reading is known.

        The speeds are constant between readings, last after the newest reading for 0.1 s or for as long as
        the last two are apart, and are zero after that and before the oldest one.
        """
        readings = self._readings
        if not readings:
            return None
        i = bisect_left(self._stamps, stamp_ns)
        if i < len(readings) and self._stamps[i] == stamp_ns:
            return readings[i]
        if i == 0:
            return readings[0]._replace(stamp_ns=stamp_ns)
        if i == len(readings):
            return self._after_newest(stamp_ns)
        return _interpolated(readings[i - 1], readings[i], stamp_ns, stamp_ns)

    def about(self, stamp_ns: int, within_ns: int) -> Array:
        """Return what tells the angles from ``within_ns`` before an instant until as long after it.

        Returns:
            Times from the instant [s] with the angles of the left and the right wheel then [rad], shape
            (R, 3): with constant speeds from one to the next, and standing wheels before the first and after
            the last one, they are those of :meth:`angles_at`. None are there before any reading is known.
        """
        first = max(bisect_right(self._stamps, stamp_ns - within_ns) - 1, 0)
        known = self._readings[first : bisect_left(self._stamps, stamp_ns + within_ns) + 1]
        if len(self._stamps) > 1 and self._stamps[-1] < stamp_ns + within_ns:
            known.append(
                self._after_newest(self._stamps[-1] + _lasts_ns(self._stamps[-1] - self._stamps[-2]))
            )
        rows = [(seconds(a.stamp_ns - stamp_ns), a.left, a.right) for a in known]
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def angles_between(self, after_ns: int, until_ns: int) -> list[WheelAngles]:
        """Return the readings strictly between two instants, then the angles at ``until_ns``."""
        end = self.angles_at(until_ns)
        if end is None:
            return []
        first, last = bisect_right(self._stamps, after_ns), bisect_left(self._stamps, until_ns)
        return [*self._readings[first:last], end]

    def newest_stamp(self, stamp_ns: int) -> int | None:
        """Return the time of the newest reading not after ``stamp_ns``."""
        i = bisect_right(self._stamps, stamp_ns)
        return self._stamps[i - 1] if i else None

    def off_by(self, stamp_ns: int) -> float:
        """Return by how much the angles at an instant are off, over an acceleration of the wheels [s^2].

        The parabola through two readings is as far as that from the straight line. It is 0 at a reading,
        where readings are dense, and where they are silent: then the wheels are taken to stand.
        """
        stamps = self._stamps
        i = min(max(bisect_left(stamps, stamp_ns), 1), len(stamps) - 1)
        if i < 1:
            return 0.0
        before_ns, after_ns = stamps[i - 1], stamps[i]
        apart_ns, beyond_ns = after_ns - before_ns, stamp_ns - after_ns
        if max(apart_ns, beyond_ns) < _DENSE_NS:
            return 0.0
        if stamp_ns < before_ns or apart_ns > _SILENT_NS or beyond_ns > _lasts_ns(apart_ns):
            return 0.0
        return 0.5 * abs(seconds(stamp_ns - before_ns) * seconds(beyond_ns))

    def _after_newest(self, stamp_ns: int) -> WheelAngles:
        newest = self._readings[-1]
        if len(self._readings) < 2:
            return newest._replace(stamp_ns=stamp_ns)
        before = self._readings[-2]
        until = min(stamp_ns, newest.stamp_ns + _lasts_ns(newest.stamp_ns - before.stamp_ns))
        return _interpolated(before, newest, until, stamp_ns)


def _lasts_ns(apart_ns: int) -> int:
    """Return the time beyond the newest reading for which the speed between the last two lasts [ns]."""
    return _EXTRAPOLATION_NS if apart_ns > _SILENT_NS else max(_EXTRAPOLATION_NS, apart_ns)


def _counted(way: float, since: float, last_way: float) -> tuple[float, float]:
    """Return the angle since a wheel began to turn the way it does, and its last way [rad].

    Args:
        way: Angle turned since the last reading.
        since: Angle at the last reading since the wheel began to turn the way it did.
        last_way: Last angle other than zero by which it turned between two readings.
    """
    if way == 0.0:
        return since, last_way
    return abs(way) + (since if way * last_way > 0.0 else 0.0), way


def _interpolated(a: WheelAngles, b: WheelAngles, time_ns: int, stamp_ns: int) -> WheelAngles:
    """Return the angles on the line through ``a`` and ``b`` at ``time_ns``, stamped ``stamp_ns``."""
    k = (time_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
    left, right = a.left + k * (b.left - a.left), a.right + k * (b.right - a.right)
    return WheelAngles(stamp_ns, left, right, b.since_left, b.since_right)
