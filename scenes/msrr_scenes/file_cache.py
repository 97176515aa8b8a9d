"""A cache of what was read from files, valid until one of them is written anew.

A program that stays, such as a notebook or the page in a browser, reads the same robot again and again, and
has to notice that somebody has edited it meanwhile.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Iterable
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")

#: When a file was written and changed [ns], its size, and which file it is: a link may be led to another one,
#: and a copy has the time of what was copied. None where there is none.
_State = tuple[int, int, int, int] | None

#: The clock of a file system is up to this far behind that of the program [ns]: it goes by the ticks of the
#: kernel, at most 10 ms long.
_CLOCK_LAG_NS = 20_000_000

#: Number of times in a row that files are read which are written all the time.
_MOST_READS = 3


class _Kept(NamedTuple, Generic[T]):
    """A value, the files that it depends on, and their states when it was read."""

    value: T
    files: tuple[Path, ...]
    states: tuple[_State, ...]


class FileCache(Generic[T]):
    """Keeps what a function reads, under the arguments that it is called with."""

    def __init__(self, read: Callable[..., tuple[T, Iterable[Path]]], most: int) -> None:
        """Begin with nothing, to keep ``most`` values at most.

        ``read`` returns a value and the files that it depends on, whether these are there or not.
        """
        self._read, self._most = read, most
        self._kept: dict[tuple[Hashable, ...], _Kept[T]] = {}

    def __call__(self, *arguments: Hashable) -> T:
        """Return the value of some arguments: the same object while its files stay as they are."""
        kept = self._kept.pop(arguments, None)
        if kept is None or kept.states != _states(kept.files):
            kept = self._read_anew(arguments)
        self._kept[arguments] = kept  # behind all that were asked for before
        while len(self._kept) > self._most:
            self._kept.pop(next(iter(self._kept)), None)
        return kept.value

    def _read_anew(self, arguments: tuple[Hashable, ...]) -> _Kept[T]:
        """Return a value with the states of its files, without states if these were always just written."""
        before: dict[Path, _State] = {}
        for _ in range(_MOST_READS):
            began_ns = time.time_ns() - _CLOCK_LAG_NS
            value, files = self._read(*arguments)
            files = tuple(dict.fromkeys(files))
            kept = _Kept(value, files, _states(files))
            # What a file depends on is known after it was read. So files that may have been written meanwhile
            # are read once more, and are compared with what they were before that.
            if all(
                state is None or state[1] < began_ns or before.get(file) == state
                for file, state in zip(files, kept.states, strict=True)
            ):
                return kept
            before = dict(zip(files, kept.states, strict=True))
        return kept._replace(states=())


def _states(files: Iterable[Path]) -> tuple[_State, ...]:
    found = list[_State]()
    for file in files:
        try:
            state = file.stat()
        except OSError:  # what reads the file says what is wrong
            found.append(None)
        else:
            found.append((state.st_mtime_ns, state.st_ctime_ns, state.st_size, state.st_ino))
    return tuple(found)
