"""A limit on the time that a trial may take on the wall clock, whatever it is doing."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

from msrr_scenes.errors import MsrrError, StoppedError
from msrr_scenes.guarded import called_in

Result = TypeVar("Result")

#: Limit of the command line [s]. The slowest shipped scene takes about a minute on one core.
DEFAULT_WALL_LIMIT_S = 600.0

#: Largest limit [s].
MAX_WALL_LIMIT_S = 1e6

#: Time after which an interrupt is raised again, in case something has swallowed it [s].
_AGAIN_S = 5.0


class WallLimitError(MsrrError):
    """A trial took longer on the wall clock than it may, and was stopped without a result."""


class _Reached(StoppedError):
    """The limit is reached; no handler of ``Exception``, such as one in a user's class, stops it."""


def check_wall_limit(limit_s: float | None) -> None:
    """Refuse a limit that no clock can wait for; None sets no limit.

    Raises:
        ValueError: The limit is no number of seconds, or none that a clock can wait for.
    """
    if limit_s is None or (isinstance(limit_s, int | float) and 0.0 < limit_s <= MAX_WALL_LIMIT_S):
        return
    raise ValueError(
        f"expected a limit above 0 s and up to {MAX_WALL_LIMIT_S:g} s on the wall clock, or None for no "
        f"limit, found {limit_s!r}"
    )


def within_wall_limit(limit_s: float | None, body: Callable[[Callable[[], None]], Result]) -> Result:
    """Return what a function returns, or stop it once it has taken ``limit_s`` seconds; None sets no limit.

    In the main thread of a process a signal interrupts any Python code, also code that never ends; what runs
    outside of Python ends first. In other threads, which get no signals, the limit holds where ``body`` calls
    the function that it is given, which raises if the limit is reached. The error names the class of a user's
    own that was called then.

    Raises:
        WallLimitError: The limit was reached.
        ValueError: The limit is no time that a clock can wait for.
    """
    check_wall_limit(limit_s)
    if limit_s is None:
        return body(lambda: None)
    begun = time.monotonic()
    interrupted, inside = False, ""

    def check() -> None:
        if time.monotonic() - begun >= limit_s:
            raise _Reached

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted, inside
        own = called_in(frame)
        if not interrupted and own is not None:
            inside = f", in {own}"
        interrupted = True
        raise _Reached

    if threading.current_thread() is not threading.main_thread():
        try:
            return body(check)
        except _Reached:
            raise _stopped(limit_s, inside) from None
    before, around = signal.getsignal(signal.SIGALRM), signal.getitimer(signal.ITIMER_REAL)

    def restore() -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if around[0] > 0.0:  # one of the program around, which goes on
            left = around[0] - (time.monotonic() - begun)
            signal.setitimer(signal.ITIMER_REAL, max(left, 1e-3), around[1])

    try:
        try:
            signal.signal(signal.SIGALRM, interrupt)
            signal.setitimer(signal.ITIMER_REAL, limit_s, _AGAIN_S)
            return body(check)
        finally:
            restore()
    except (_Reached, Exception) as error:
        restore()  # an alarm that came while it was switched off has cut the first one short
        # Compiled code that is interrupted in a call of Python, such as numba's, makes a SystemError of it.
        if not interrupted and not isinstance(error, _Reached):
            raise
        raise _stopped(limit_s, inside) from None


def _stopped(limit_s: float, inside: str) -> WallLimitError:
    return WallLimitError(
        f"the trial was stopped after {limit_s:g} s on the wall clock{inside}; raise --wall-limit, or "
        "simplify it"
    )
