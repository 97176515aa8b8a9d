"""Periodic events and delayed messages on an integer time axis of nanoseconds."""

from __future__ import annotations

import heapq
import math
from typing import Generic, TypeVar

from msrr_scenes.messages import NS_PER_S

T = TypeVar("T")

#: A time that never comes [ns].
NEVER_NS = math.inf


def duration_ns(time_s: float) -> int:
    """Return a duration [s] as whole nanoseconds."""
    return round(time_s * NS_PER_S)


class Periodic:
    """A periodic event of any rate; it happens at the first tick at or after each due time k / rate."""

    def __init__(self, rate_hz: float, start_ns: int = 0) -> None:
        """Start at ``start_ns``, when the first event is due."""
        self._rate = rate_hz
        self._start = start_ns
        self._count = 0
        self.next_ns = start_ns

    def due(self, now_ns: int) -> bool:
        """Return whether an event is due at this tick, and advance to the next event.

        Events whose due times passed between two calls count as one.
        """
        if now_ns < self.next_ns:
            return False
        elapsed = (now_ns - self._start) / NS_PER_S
        self._count = max(self._count + 1, int(elapsed * self._rate) + 1)
        # Start and tick are rounded each. The tick that is due is later by the time rounded up or down.
        self.next_ns = self._start + math.floor(self._count * NS_PER_S / self._rate + 1e-6)
        return True


class Delayed(Generic[T]):
    """A queue of messages with times of arrival; messages that arrive together keep the order of sending."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, T]] = []
        self._sent = 0
        self.next_ns = NEVER_NS

    def send(self, arrival_ns: int, message: T) -> None:
        """Add a message that arrives at ``arrival_ns``."""
        heapq.heappush(self._heap, (arrival_ns, self._sent, message))
        self._sent += 1
        self.next_ns = self._heap[0][0]

    def arrived(self, now_ns: int) -> list[T]:
        """Remove and return the messages that have arrived by ``now_ns``."""
        messages: list[T] = []
        while self.next_ns <= now_ns:
            messages.append(heapq.heappop(self._heap)[2])
            self.next_ns = self._heap[0][0] if self._heap else NEVER_NS
        return messages
