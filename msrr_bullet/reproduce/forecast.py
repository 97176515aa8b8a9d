"""How far a long run is, and how much longer it takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(slots=True)
class _Kind:
    """Trials of one kind: how many there are, are done, were run for that, and how long those took."""

    all: int
    weight: float
    done: int = 0
    run: int = 0
    seconds: float = 0.0


class Forecast:
    """Counts trials of several kinds and estimates what is left of them.

    Trials of a kind that has begun are taken to go on as they did; those of another to take as long as their
    weight says.
    """

    def __init__(
        self, kinds: Mapping[str, tuple[int, float]], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Plan the trials.

        Args:
            kinds: How many trials of each kind, and how long one of them takes in proportion to the others.
            clock: Time [s].
        """
        self._kinds = {name: _Kind(count, weight) for name, (count, weight) in kinds.items()}
        self._clock = clock
        self._then = clock()

    def kept(self, kind: str, count: int) -> None:
        """Note trials that need not be run."""
        self._kinds[kind].done += count
        self._then = self._clock()

    def ran(self, kind: str) -> None:
        """Note that a trial was run, and what time has passed since the one before it."""
        now, found = self._clock(), self._kinds[kind]
        found.done, found.run = found.done + 1, found.run + 1
        found.seconds, self._then = found.seconds + now - self._then, now

    @property
    def seconds_left(self) -> float | None:
        """Estimate [s]; None before the first trial was run."""
        known = [k for k in self._kinds.values() if k.run]
        if not known:
            return None
        of_one = sum(k.seconds for k in known) / sum(k.run * k.weight for k in known)
        return sum(
            (k.all - k.done) * (k.seconds / k.run if k.run else of_one * k.weight)
            for k in self._kinds.values()
        )

    def __str__(self) -> str:
        """Return how many of all trials are done, and what is left."""
        done, total = (sum(getattr(k, name) for k in self._kinds.values()) for name in ("done", "all"))
        left = self.seconds_left
        text = f"{done} of all {total}"
        return text if left is None else f"{text}, about {_duration(left)} left"


def _duration(span: float) -> str:
    """Return a time span [s] as a person would say it."""
    if span < 90.0:
        return f"{span:.0f} s"
    minutes = round(span / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
