"""Measurement of the wall-clock time that a trial spends in named stages.

Only the benchmarks read the times. Nothing in a trial may depend on them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from time import perf_counter_ns

#: A source of context managers that measure the time of a stage: ``with profiler("physics"): ...``.
Profiler = Callable[[str], AbstractContextManager[object]]


class StageProfiler:
    """Adds up the wall-clock time spent in each stage, exclusively.

    A stage entered inside another one stops the outer one, so that no nanosecond is counted twice and the sum
    of all stages is the time spent under the outermost ones. A stage may enter itself.
    """

    def __init__(self, now_ns: Callable[[], int] = perf_counter_ns) -> None:
        """Read the time from ``now_ns`` [ns], a monotonic clock."""
        self._now = now_ns
        self._stages: dict[str, _Stage] = {}
        self._running: list[_Stage] = []
        self._since = 0
        self._first: int | None = None

    def __call__(self, stage: str) -> _Stage:
        """Return the context manager that times ``stage``."""
        known = self._stages.get(stage)
        if known is None:
            known = self._stages[stage] = _Stage(self)
        return known

    @property
    def spent_ns(self) -> dict[str, int]:
        """Wall-clock time of each stage [ns], in the order of first use."""
        return {name: stage.spent_ns for name, stage in self._stages.items()}

    @property
    def total_ns(self) -> int:
        """Wall-clock time of all stages together [ns]."""
        return sum(stage.spent_ns for stage in self._stages.values())

    @property
    def span_ns(self) -> int:
        """Wall-clock time from the first entry into a stage to the last entry or exit [ns]; 0 without one."""
        return 0 if self._first is None else self._since - self._first

    def _enter(self, stage: _Stage) -> None:
        now = self._now()
        if self._first is None:
            self._first = now
        if self._running:
            self._running[-1].spent_ns += now - self._since
        self._running.append(stage)
        self._since = now

    def _exit(self) -> None:
        now = self._now()
        self._running.pop().spent_ns += now - self._since
        self._since = now


class _Stage:
    """The context manager of one stage, which may be entered any number of times."""

    __slots__ = ("_profiler", "spent_ns")

    def __init__(self, profiler: StageProfiler) -> None:
        self._profiler = profiler
        self.spent_ns = 0

    def __enter__(self) -> None:
        self._profiler._enter(self)

    def __exit__(self, *_: object) -> None:
        self._profiler._exit()


class NullProfiler:
    """A profiler that measures nothing, the default of a trial."""

    def __call__(self, stage: str) -> AbstractContextManager[None]:
        """Return a context manager that does nothing."""
        return _NOTHING


_NOTHING = nullcontext()
