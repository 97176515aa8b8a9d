"""What a state of a docking step remembers of one stay in it."""

from __future__ import annotations

import math

from msrr_control.sequence.observation import Observation
from msrr_control.sequence.port_view import PortView
from msrr_scenes.messages import seconds


class HoldTimer:
    """Measures how long a condition has held without a break."""

    def __init__(self) -> None:
        """Begin with a condition that does not hold."""
        self._since_ns: int | None = None

    def update(self, holds: bool, now_ns: int) -> float:
        """Return the time [s] for which the condition has held; -1 while it does not."""
        if not holds:
            self._since_ns = None
            return -1.0
        if self._since_ns is None:
            self._since_ns = now_ns
        return seconds(now_ns - self._since_ns)


class StateMemory:
    """The memory of one stay in a phase.

    Attributes:
        since_ns: Time at which the phase was entered.
        seen_s: Time for which the target has been seen, all in all, without a slow approach to it [s].
        crept_s: Time of the slow approach to the target since it was last seen [s].
        unseen: Timer of the target being unseen.
        switches: Timer of the seat switches saying what the phase waits for.
        parted: Timer of the seat switches being open at the port after one of them had closed there.
        parted_gap: Gap at which they opened [m].
        opened: Timer of the lock being open.
        looked_behind: Timer of the unit knowing what is behind it, or no longer waiting to know.
        arrived: Timer of the unit standing at the end of its retreat or tug.
        backing: What was observed when the unit was last commanded to back out: the collision monitor lets a
            command to stand still pass, whatever is near.
        leg: Leg of the calibration drive under way, counted from 0.
        limited: Timer of the collision monitor slowing or stopping the unit.
        doubted: Timer of the collision monitor stopping it because nobody knows where others are.
        sigma_lateral: Smallest standard deviation of the lateral estimate [m] on the way to the port, near
            which wheels that may spin make it larger; 0 in a stay that begins there.
        sigma_yaw: That of the heading [rad].
        pushed: Way that the unit was let push on at the port since it last made progress [m].
        pressed: Whether that is more than what counts as progress, so that the pins must hold the unit.
        before: View before a tug test; None in other phases.
        tugged: Way that the unit was let drive backwards in a tug test [m].
        frames: Number of frames in a row that agreed, as :meth:`frames_in_a_row` has counted them.
    """

    def __init__(self, since_ns: int) -> None:
        """Begin a stay."""
        self.since_ns = since_ns
        self.seen_s, self.leg = 0.0, 0
        self.crept_s = 0.0
        self.unseen, self.switches, self.arrived = HoldTimer(), HoldTimer(), HoldTimer()
        self.opened, self.looked_behind, self.limited = HoldTimer(), HoldTimer(), HoldTimer()
        self.doubted, self.parted = HoldTimer(), HoldTimer()
        self.backing: Observation | None = None
        self.sigma_lateral = self.sigma_yaw = self.pushed = self.parted_gap = 0.0
        self.pressed = False
        self.before: PortView | None = None
        self.tugged = 0.0
        self._best, self._best_ns = math.inf, since_ns
        self.frames, self._last_frame_ns = 0, since_ns

    def lasted(self, now_ns: int) -> float:
        """Return the time [s] since the phase was entered."""
        return seconds(now_ns - self.since_ns)

    def without_progress(self, remaining: float, smallest: float, way: float, now_ns: int) -> float:
        """Return the time [s] since ``remaining`` [m] last made progress.

        Progress is a fall by ``way`` [m], or to half of where it began, and by ``smallest`` [m] at least.
        """
        if remaining < self._best - self.next_progress(smallest, way):
            self._best, self._best_ns, self.pushed = remaining, now_ns, 0.0
        return seconds(now_ns - self._best_ns)

    def next_progress(self, smallest: float, way: float) -> float:
        """Return the fall that counts as progress next [m]; see :meth:`without_progress`."""
        return max(smallest, min(way, 0.5 * self._best))

    def pause(self, now_ns: int) -> None:
        """Let the time without progress begin anew: nothing can be expected of the unit now."""
        self._best_ns = now_ns

    def slowed(self, share: float, dt: float) -> None:
        """Let the time without progress run by a share of ``dt`` [s]: the unit drives at that share only."""
        self._best_ns += round(1e9 * (1.0 - share) * dt)

    def frames_in_a_row(self, exposed_ns: int, agrees: bool) -> int:
        """Count the frames exposed since the phase began that agree, from the last one that did not."""
        if exposed_ns > self._last_frame_ns:
            self._last_frame_ns = exposed_ns
            self.frames = self.frames + 1 if agrees else 0
        return self.frames
