"""The cam of a lock, the travel of its switches, and what a pull at it shows: the same for every plant."""

from __future__ import annotations

from dataclasses import dataclass

from msrr_scenes.messages import LockPosition

#: A seat switch closes when its pin is this close to the bottom of the hole [m].
SWITCH_TRAVEL = 0.002
#: The cam catches a pin that is this close to the bottom of its hole [m]; a little beyond the switch's
#: travel, so that a closed switch means a pin in reach.
CAM_REACH = 0.0025
#: A lock that gives this much under the pull has given way [m].
PULL_SLACK = 0.002


@dataclass(frozen=True, slots=True)
class PullResult:
    """What a pull along the docking axis showed.

    Attributes:
        force_n: Force on each of the two bodies, apart.
        displacement_m: How far they came apart along the axis, up to where the test was broken off.
        holds: The lock did not give way.
    """

    force_n: float
    displacement_m: float
    holds: bool


class LockActuator:
    """The cam's own motion, whatever it may hold: open at once, closed after its closing time."""

    def __init__(self, close_time_s: float) -> None:
        """Start open."""
        self._close_time_s = close_time_s
        self._closing_s = 0.0
        self.position = LockPosition.OPEN

    def command(self, close: bool) -> None:
        """Start to close, or open. A cam that is closing or closed goes on when told to close again."""
        if not close:
            self.position = LockPosition.OPEN
        elif self.position is LockPosition.OPEN:
            self.position, self._closing_s = LockPosition.CLOSING, 0.0

    def step(self, dt: float) -> bool:
        """Advance by ``dt`` [s]; say whether the cam has just reached its end."""
        if self.position is not LockPosition.CLOSING:
            return False
        self._closing_s += dt
        if self._closing_s + 1e-9 < self._close_time_s:
            return False
        self.position = LockPosition.CLOSED
        return True
