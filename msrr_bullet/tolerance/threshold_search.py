"""The search for the size at which an effect becomes too large: bisection that brackets it."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass

#: Ratio of the two sizes of a bracket at which the search ends.
RESOLUTION = 1.25

#: Smallest size that is tried, over the first one.
_SMALLEST = 1.0 / 16.0


@dataclass(frozen=True, slots=True)
class Bracket:
    """Two sizes between which an effect becomes too large.

    Attributes:
        holds: Largest size at which all is well; 0 if that is so at none that was tried.
        fails: Smallest size beyond ``holds`` at which it is not; None if all is well to the top.
    """

    holds: float
    fails: float | None

    @property
    def middle(self) -> float | None:
        """The size between the two by which the threshold is written as one number; None if there is none."""
        if self.fails is None:
            return None
        return math.sqrt(self.holds * self.fails) if self.holds else 0.5 * self.fails


def threshold_search(first: float, top: float) -> Generator[float, bool, Bracket]:
    """Yield sizes to be tried, is sent whether all is well at each, and return the bracket.

    The first size, which is positive, then the top is tried. Between a size that holds and one that fails the
    next one is their geometric mean, because sizes matter by their ratio; below a first size that fails it is
    a quarter.
    """
    first = min(first, top)
    holds, fails = 0.0, first
    if (yield first):
        if first == top or (yield top):
            return Bracket(top, None)
        holds, fails = first, top
    while fails > RESOLUTION * holds:
        size = math.sqrt(holds * fails) if holds else 0.25 * fails
        if size < _SMALLEST * first:
            break
        if (yield size):
            holds = size
        else:
            fails = size
    return Bracket(holds, fails)
