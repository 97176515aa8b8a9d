"""What the phase machine's phases hand on, and what each remembers while it lasts."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_scenes.messages import FailureReason, Phase, seconds


@dataclass(frozen=True, slots=True)
class Transition:
    """A change of phase and why.

    Attributes:
        to: The phase that comes.
        reason: For the log and the reader.
        setback: Why the attempt failed, None if it did not.
        reassemble: The next attempt should begin from afar, the hand-over itself having failed.
    """

    to: Phase
    reason: str
    setback: FailureReason | None = None
    reassemble: bool = False


class HoldTimer:
    """How long a condition has held without a break."""

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
        since_ns: Its beginning.
        turned: Heading turned since the target was last seen, by odometry [rad].
        unseen: How long the target has been unseen.
        switches: How long the seat switches have said what the phase watches for.
        opened: How long the lock has been open.
        overlooked: How long the unit has known what is behind it, or has stopped waiting to.
        arrived: How long the unit has stood at the end of its retreat.
    """

    def __init__(self, since_ns: int) -> None:
        """Begin a stay."""
        self.since_ns = since_ns
        self.turned = 0.0
        self.unseen, self.switches, self.arrived = HoldTimer(), HoldTimer(), HoldTimer()
        self.opened, self.overlooked = HoldTimer(), HoldTimer()
        self._best, self._best_ns = math.inf, since_ns
        self._frames, self._last_frame_ns = 0, since_ns

    def lasted(self, now_ns: int) -> float:
        """Return the time [s] since the phase was entered."""
        return seconds(now_ns - self.since_ns)

    def without_progress(self, to_go: float, step: float, now_ns: int) -> float:
        """Return the time [s] since ``to_go`` [m] last fell by at least ``step`` [m] below its best."""
        if to_go < self._best - step:
            self._best, self._best_ns = to_go, now_ns
        return seconds(now_ns - self._best_ns)

    def frames_in_a_row(self, exposed_ns: int, agrees: bool) -> int:
        """Count the frames exposed since the phase began that agree, from the last that did not."""
        if exposed_ns > self._last_frame_ns:
            self._last_frame_ns = exposed_ns
            self._frames = self._frames + 1 if agrees else 0
        return self._frames
