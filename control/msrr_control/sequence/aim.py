"""Where a unit docks after pins have jammed: the search for the port to the side of the axis."""

from __future__ import annotations

import math
from collections.abc import Iterator


class Aim:
    """Where a unit docks beside the axis after its pins have jammed, most likely as sight is wrong about it.

    A funnel that pushes the pins to one side turns the unit to that side, so each jam tells on which side of
    the place that was aimed at the port is. Beyond a jam on either side the next place is halfway.

    Attributes:
        lateral: Distance from the axis of the dock frame, to its left [m].
    """

    def __init__(self) -> None:
        """Begin on the axis."""
        self.lateral = 0.0
        self._right, self._left = -math.inf, math.inf  # places that the port is between
        self._stops, self._first = 0, 0.0

    def jammed(self, step: float, to_left: bool) -> None:
        """Aim elsewhere after a jam.

        ``step`` is the way to the next place while the port is known to be on one side only [m].
        """
        if to_left:
            self._right = self.lateral
        else:
            self._left = self.lateral
        if math.isinf(self._left):
            self.lateral += step
        elif math.isinf(self._right):
            self.lateral -= step
        else:
            self.lateral = 0.5 * (self._right + self._left)

    def stopped(self, step: float, to_left: bool) -> None:
        """Aim elsewhere after the pins have stopped before the holes, where no funnel turns the unit.

        The port is as likely on the one side as on the other: the unit tries both, one after the other, and
        then both twice as far away, but nothing that jams have ruled out. ``step`` is the way to the first
        place [m]; without one it aims at the same again.
        """
        if not self._stops:
            self._first = step if to_left else -step
        farthest = max(-self._right, self._left)
        for place in self._beside():
            if abs(place) > farthest:
                self.lateral = 0.5 * (self._right + self._left)
            elif place != self.lateral and self._right < place < self._left:
                self.lateral = place
            else:
                continue
            return

    def _beside(self) -> Iterator[float]:
        """Yield the places to both sides of the axis that have not been tried, the nearest first [m]."""
        while self._first:
            self._stops += 1
            times = (self._stops + 1) // 2
            yield times * (self._first if self._stops % 2 else -self._first)
