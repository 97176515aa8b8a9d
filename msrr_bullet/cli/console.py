"""The console of the command line: text appears as it is, for names and reasons may hold ``[brackets]``."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from shutil import get_terminal_size
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # loaded by the commands that print with them, so that msrr --help is quick
    from rich.console import Console
    from rich.progress import Progress


def open_closed_streams() -> None:
    """Open the standard streams that were closed when the program was started, on the null device.

    Else the next files would get their descriptors, and with them all that C prints.
    """
    for descriptor, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        try:
            os.fstat(descriptor)
        except OSError:
            opened = open(os.devnull, mode, encoding="utf-8")  # noqa: SIM115 - until the process ends
            os.set_inheritable(opened.fileno(), True)  # the lowest number that is free, which is this one
            setattr(sys, name, opened)


def open_console(*, stderr: bool = False) -> Console:
    """Return a console that reads no markup and no emoji codes in what it prints, tables included."""
    from rich.console import Console

    class PlainConsole(Console):
        def on_broken_pipe(self) -> None:
            # Called where a BrokenPipeError is handled; Rich would end the program there, with work undone.
            raise

    # Where COLUMNS is 0 Rich prints nothing at all.
    width = get_terminal_size().columns if os.environ.get("COLUMNS") == "0" else None
    return PlainConsole(stderr=stderr, markup=False, emoji=False, width=width)


@contextmanager
def status_line(console: Console, text: str) -> Iterator[Callable[[str], None]]:
    """Show ``text`` beside a spinner, on a terminal; yield the function that replaces it."""
    from rich.text import Text

    if not console.is_terminal:  # Rich would end it by an empty line, which may not find room
        yield lambda new: None
        return
    # A status made from a plain text reads markup in it, whatever its console does.
    with console.status(Text(text)) as status:
        yield lambda new: status.update(Text(new))


def progress_bar(console: Console) -> Progress:
    """Return a display of tasks: the name of each, a bar, how much is done, and the time that is left."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
    )
