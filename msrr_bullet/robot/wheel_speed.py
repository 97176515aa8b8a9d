"""The velocity of a unit by its wheel encoders."""

from __future__ import annotations

from msrr_scenes.messages import Twist, WheelOdometry, seconds


class WheelSpeed:
    """Keeps the last two encoder readings of a unit."""

    def __init__(self, wheel_radius: float, track: float) -> None:
        """Take the radius of the wheels and the distance between them, by calibration [m]."""
        self._radius, self._track = wheel_radius, track
        self._before: WheelOdometry | None = None
        self._last: WheelOdometry | None = None

    def add(self, reading: WheelOdometry) -> None:
        """Take in a reading; one that a driver delivers twice has no effect."""
        if self._last is None or reading.stamp_ns != self._last.stamp_ns:
            self._before, self._last = self._last, reading

    @property
    def twist(self) -> Twist:
        """Velocity between the last two readings; zero before there are two."""
        if self._before is None or self._last is None:
            return Twist()
        dt = seconds(self._last.stamp_ns - self._before.stamp_ns)
        left = self._radius * (self._last.left - self._before.left) / dt
        right = self._radius * (self._last.right - self._before.right) / dt
        return Twist(0.5 * (left + right), (right - left) / self._track)
