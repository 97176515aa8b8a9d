"""The lock actuator and the travel of the seat switches, for every plant."""

from __future__ import annotations

from msrr_scenes.messages import LockPosition

#: A seat switch closes when the pin is this close to the bottom of the hole [m].
SWITCH_TRAVEL = 0.002
#: The lock catches a pin that is this close to the bottom of the hole [m]: a little more than the travel of
#: the switch, so that a closed switch means a pin in reach.
LOCK_REACH = 0.0025
#: Distance by which pitch and roll move a port over the floor, at most [m].
TILT_M = 0.01


class LockActuator:
    """The motion of a lock, whether or not it catches a pin: opens at once, closes after a closing time."""

    def __init__(self, close_time_s: float) -> None:
        """Start open; closing takes ``close_time_s`` [s]."""
        self._close_time_s = close_time_s
        self._closing_s = 0.0
        self.position = LockPosition.OPEN

    def command(self, close: bool) -> None:
        """Start to close, or open. A command to close changes nothing in a lock that is not open."""
        if not close:
            self.position = LockPosition.OPEN
        elif self.position is LockPosition.OPEN:
            self.position, self._closing_s = LockPosition.CLOSING, 0.0

    def step(self, dt: float) -> bool:
        """Advance by ``dt`` [s]; return whether the lock has just become closed."""
        if self.position is not LockPosition.CLOSING:
            return False
        self._closing_s += dt
        if self._closing_s + 1e-9 < self._close_time_s:
            return False
        self.position = LockPosition.CLOSED
        return True
