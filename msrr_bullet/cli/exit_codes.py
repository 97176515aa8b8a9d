"""The exit codes of the command line, and how errors and interrupts become them."""

from __future__ import annotations

import _thread
import errno
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from typer.core import TyperGroup

from msrr_scenes.errors import MsrrError, StoppedError

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

#: Exit code of a trial that did not end docked, of a replay that differs from the log, or whose log ends
#: early, of a benchmark in which a trial costs much more than before, and where the reader of the output has
#: gone away. A command that did what was asked ends with 0, and so does a trial that ended docked.
NOT_DOCKED = 1

#: Exit code for wrong arguments, a scene that cannot be used, a file that cannot be read or written, and for
#: a trial in which a class of the user's own failed or that took too long on the wall clock.
BAD_INPUT = 2

#: Exit code for an error of the program itself.
PROGRAM_ERROR = 70

#: Exit code after Ctrl-C.
INTERRUPTED = 130

#: How Python's message begins when links lead in a circle; behind it comes the path.
_LOOP = "Symlink loop from "

#: Time after which an interrupt that was lost in a callback is raised again [s].
_RETRY_S = 0.1


class Terminated(StoppedError):
    """A signal ends the program, such as SIGTERM; an exception closes every server, process and file.

    It is no SystemExit: that one may come from a class of the user's own, and then ends the trial alone.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class ExitCodeGroup(TyperGroup):
    """A group of commands that turns errors and interrupts into one message and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        with _swallowed_interrupts() as swallowed:
            result = self._invoke(ctx, swallowed)
            if swallowed:
                raise SystemExit(report_signal(swallowed[0]))
            return result

    def _invoke(self, ctx: Any, swallowed: Sequence[int]) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise SystemExit(report_signal(signal.SIGINT)) from None
        except Terminated as end:
            raise SystemExit(report_signal(end.number)) from None
        except BrokenPipeError:  # the reader of the output has gone away
            raise SystemExit(NOT_DOCKED) from None
        except OSError as error:
            raise SystemExit(report_error(os_error_text(error), BAD_INPUT)) from None
        except MsrrError as error:
            raise SystemExit(report_error(str(error), BAD_INPUT)) from None
        except Exception as error:
            if swallowed:  # the error may follow from the work that the interrupt cut short
                raise SystemExit(report_signal(swallowed[0])) from None
            if hasattr(error, "exit_code"):  # typer's own exceptions: usage errors, and the end of a command
                raise
            if isinstance(error, RuntimeError) and str(error).startswith(_LOOP):  # of Path.resolve()
                text = f"{str(error).removeprefix(_LOOP)}: a link that leads back to itself; name a file"
                raise SystemExit(report_error(text, BAD_INPUT)) from None
            if isinstance(error, ValueError) and sys.stdout.closed:
                text = "the standard output was closed before the end; a class of your own must not do that"
                raise SystemExit(report_error(text, BAD_INPUT)) from None
            traceback.print_exc()
            text = "this is an error of the program; please report it with the lines above"
            raise SystemExit(report_error(text, PROGRAM_ERROR)) from None


def flush_output(code: int) -> int:
    """Write what is left of the standard output, and return the exit code: ``code``, unless that fails first.

    What could not be written is dropped then, for Python would try again at exit, and report that once more.
    """
    if sys.stdout.closed:  # by a class of the user's own
        return code
    try:
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if code == 0:
            gone = isinstance(error, BrokenPipeError)
            return NOT_DOCKED if gone else report_error(os_error_text(error), BAD_INPUT)
    return code


def report_signal(number: int) -> int:
    """Write to standard error that a signal has ended the program, and return the exit code."""
    if number == signal.SIGINT:
        return report_error("interrupted", INTERRUPTED)
    return report_error("terminated", 128 + number)


@contextmanager
def _swallowed_interrupts() -> Iterator[Sequence[int]]:
    """Collect the signals whose exception a callback from C could not raise, and send each again a bit later.

    numba's compiler calls back from C. Python can only report an exception that is raised there, and goes on.
    """
    numbers: list[int] = []
    timers: list[threading.Timer] = []
    original_hook = sys.unraisablehook

    def retry(unraisable: UnraisableHookArgs) -> None:
        error = unraisable.exc_value
        if not isinstance(error, (KeyboardInterrupt, Terminated)):
            original_hook(unraisable)
            return
        numbers.append(error.number if isinstance(error, Terminated) else signal.SIGINT)
        timers.append(threading.Timer(_RETRY_S, _thread.interrupt_main, [numbers[-1]]))
        timers[-1].daemon = True
        timers[-1].start()

    sys.unraisablehook = retry
    try:
        yield numbers
    finally:
        sys.unraisablehook = original_hook
        for timer in timers:
            timer.cancel()


def os_error_text(error: OSError) -> str:
    """Return an error of the operating system as other messages are: first the place, without its number."""
    if error.strerror is None:
        return str(error)
    if error.filename is None and error.errno == errno.ENOENT:  # of os.getcwd()
        return "the working folder is not there any more; change to another one"
    text = error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"
    return f"{text}; make room, or name another place" if error.errno == errno.ENOSPC else text


def report_error(message: str, code: int) -> int:
    """Write a message to standard error and return ``code``."""
    print(f"msrr: {message}", file=sys.stderr)  # noqa: T201 - plain text, no markup
    return code
