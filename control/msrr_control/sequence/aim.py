"""Where a unit docks after failed attempts: the search for the port beside the axis, and for its heading."""

from __future__ import annotations

import math
from collections.abc import Iterator

from msrr_scenes.geometry.se2 import SE2


class _Bracket:
    """Where a value is sought that is known to be on one side of each that was tried.

    Attributes:
        value: Value to try.
        low, high: Values that it is between.
    """

    def __init__(self) -> None:
        """Begin at 0."""
        self.value, self.low, self.high = 0.0, -math.inf, math.inf

    def only_missed(self, upwards: bool) -> bool:
        """Return whether values were tried, and the one sought is above them all (``upwards``), or below."""
        this, other = (self.low, self.high) if upwards else (self.high, self.low)
        return math.isfinite(this) and math.isinf(other)

    def missed(self, step: float, upwards: bool) -> None:
        """Try another value, as the one sought is above the present one (``upwards``), or below it.

        ``step`` is the way to the next value while one side is open; then the next is halfway.
        """
        if upwards:
            self.low = self.value
        else:
            self.high = self.value
        if math.isinf(self.high):
            self.value += step
        elif math.isinf(self.low):
            self.value -= step
        else:
            self.value = 0.5 * (self.low + self.high)


class Aim:
    """Where a unit docks beside the axis after failed attempts, most likely as sight is wrong about it.

    A funnel that pushes the pins to one side turns the unit to that side, so each jam tells on which side of
    the place that was aimed at the port is. Beyond a jam on either side the next place is halfway. Likewise
    the pin that is at the bottom first tells to which side the unit was turned as it came in.
    """

    def __init__(self) -> None:
        """Begin on the axis."""
        self._lateral, self._yaw = _Bracket(), _Bracket()
        self._stops, self._first = 0, 0.0

    @property
    def lateral(self) -> float:
        """Distance from the axis of the dock frame, to its left [m]."""
        return self._lateral.value

    @property
    def yaw(self) -> float:
        """Heading against that axis [rad]."""
        return self._yaw.value

    @property
    def X_DA(self) -> SE2:
        """Frame A that the unit takes for the dock frame D."""
        return SE2(0.0, self.lateral, self.yaw)

    def jammed(self, step: float, to_left: bool) -> bool:
        """Aim elsewhere after a jam; return whether all jams before it, at least one, were to the same side.

        ``step`` is the way to the next place while the port is known to be on one side only [m].
        """
        again = self._lateral.only_missed(to_left)
        self._lateral.missed(step, to_left)
        return again

    def turned(self, step: float, to_left: bool) -> None:
        """Aim at another heading, as the unit came in turned to one side; ``step`` is as in a jam [rad]."""
        self._yaw.missed(step, not to_left)

    def stopped(self, step: float, to_left: bool) -> None:
        """Aim elsewhere after the pins have stopped before the holes, where no funnel turns the unit.

        The port is as likely on the one side as on the other: the unit tries both, one after the other, and
        then both twice as far away, but nothing that jams have ruled out. ``step`` is the way to the first
        place [m]; without one it aims at the same again.
        """
        if not self._stops:
            self._first = step if to_left else -step
        right, left = self._lateral.low, self._lateral.high
        farthest = max(-right, left)
        for place in self._beside():
            if abs(place) > farthest:
                self._lateral.value = 0.5 * (right + left)
            elif place != self.lateral and right < place < left:
                self._lateral.value = place
            else:
                continue
            return

    def _beside(self) -> Iterator[float]:
        """Yield the places to both sides of the axis that have not been tried, the nearest first [m]."""
        while self._first:
            self._stops += 1
            times = (self._stops + 1) // 2
            yield times * (self._first if self._stops % 2 else -self._first)
