"""When things happen: periodic events and messages under way, on an integer clock."""

from __future__ import annotations

import heapq
from typing import Generic, TypeVar

from msrr_scenes.messages import NS_PER_S

T = TypeVar("T")


def duration_ns(time_s: float) -> int:
    """Return a duration [s] as whole nanoseconds."""
    return round(time_s * NS_PER_S)


class Periodic:
    """An event of any rate; it happens at the first tick at or after each due time k / rate."""

    def __init__(self, rate_hz: float, start_ns: int = 0) -> None:
        """Start counting at ``start_ns``, where the first event is due."""
        self._rate = rate_hz
        self._start = start_ns
        self._count = 0

    def due(self, now_ns: int) -> bool:
        """Say whether an event falls on this tick, and step on to the next one.

        Due times that were passed over (nobody asked) are dropped, not made up for.
        """
        if now_ns < self._start + round(self._count * NS_PER_S / self._rate):
            return False
        elapsed = (now_ns - self._start) / NS_PER_S
        self._count = max(self._count + 1, int(elapsed * self._rate) + 1)
        return True


class Delayed(Generic[T]):
    """Messages under way: each arrives at the first tick at or after its time, ties in order of sending."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, T]] = []
        self._sent = 0

    def send(self, arrival_ns: int, message: T) -> None:
        """Put ``message`` under way."""
        heapq.heappush(self._heap, (arrival_ns, self._sent, message))
        self._sent += 1

    def arrived(self, now_ns: int) -> list[T]:
        """Take out everything that has arrived by ``now_ns``."""
        out = []
        while self._heap and self._heap[0][0] <= now_ns:
            out.append(heapq.heappop(self._heap)[2])
        return out
