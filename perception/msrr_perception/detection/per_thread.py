"""What each thread makes once for itself and keeps until it ends."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import Any, TypeVar, TypeVarTuple

T = TypeVar("T")
Arguments = TypeVarTuple("Arguments")


class _Kept(threading.local):
    """What the present thread has made, by process, for a forked child has it too, and by arguments."""

    def __init__(self) -> None:
        self.made: dict[tuple[int, tuple[Any, ...]], Any] = {}


def kept_per_thread(make: Callable[[*Arguments], T]) -> Callable[[*Arguments], T]:
    """Decorate a function so that it makes one thing for equal arguments in each thread of each process."""
    kept = _Kept()

    def made(*arguments: *Arguments) -> T:
        key = os.getpid(), arguments
        if key not in kept.made:
            kept.made[key] = make(*arguments)
        found: T = kept.made[key]
        return found

    return made
