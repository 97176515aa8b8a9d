"""The progress of a long run of trials, and an estimate of the time that is left."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from msrr_bullet.run_folder import ProgressListener


@dataclass(slots=True)
class _Group:
    """Trials that take about as long as each other: their number, and how many are done and were run."""

    total: int
    weight: float
    done: int = 0
    run: int = 0
    seconds: float = 0.0


class Forecast:
    """Counts trials of several groups and estimates how long the rest of them takes.

    A trial of a group that has begun is taken to last as long as the average of those that were run; a trial
    of another group as long as the group's weight says.
    """

    def __init__(
        self, groups: Mapping[str, tuple[int, float]], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Plan the trials.

        Of each group it needs the number of trials, and the duration of one relative to the other groups.
        """
        self._groups = {name: _Group(count, weight) for name, (count, weight) in groups.items()}
        self._clock = clock
        self._last = clock()

    def count(self, group: str, stored: bool) -> None:
        """Count a trial, with the time since the trial before it unless it was stored and not run."""
        now, counts = self._clock(), self._groups[group]
        counts.done += 1
        if not stored:
            counts.run += 1
            counts.seconds += now - self._last
        self._last = now

    @property
    def seconds_left(self) -> float | None:
        """Estimated time left [s]; None before the first trial was run."""
        begun = [g for g in self._groups.values() if g.run]
        if not begun:
            return None
        per_weight = sum(g.seconds for g in begun) / sum(g.run * g.weight for g in begun)
        return sum(
            (g.total - g.done) * (g.seconds / g.run if g.run else per_weight * g.weight)
            for g in self._groups.values()
        )

    def __str__(self) -> str:
        """Return the number of trials that are done, and the time left."""
        done, total = (sum(getattr(g, name) for g in self._groups.values()) for name in ("done", "total"))
        left = self.seconds_left
        text = f"{done} of all {total}"
        return text if left is None else f"{text}, about {_duration(left)} left"


class TrialCounter:
    """Counts the trials of one controller in one experiment and reports how far the whole run is."""

    def __init__(
        self, listener: ProgressListener, forecast: Forecast, experiment: str, label: str, total: int
    ) -> None:
        self._listener, self._forecast = listener, forecast
        self._experiment, self._label, self._total = experiment, label, total
        self._done = 0

    def count(self, outcome: object, stored: bool) -> None:
        """Count a trial; an observer of :func:`msrr_bullet.sweep.trials.run_trials`."""
        self._done += 1
        self._forecast.count(self._experiment, stored)
        self.report()

    def report(self) -> None:
        """Say how far the run is."""
        self._listener(f"{self._experiment}, {self._label}: {self._done} of {self._total} ({self._forecast})")


def _duration(span: float) -> str:
    """Return a time span [s] in words."""
    if span < 90.0:
        return f"{span:.0f} s"
    minutes = round(span / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
