"""How a command ends: one message for all that can be expected, and a telling exit code."""

from __future__ import annotations

import _thread
import os
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from typer.core import TyperGroup

from msrr_scenes.errors import MsrrError

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

NOT_DOCKED = 1
BAD_INPUT = 2
PROGRAM_ERROR = 70
INTERRUPTED = 130

#: How soon an interrupt that got lost is raised again [s].
_AGAIN_S = 0.1


class ExitCodeGroup(TyperGroup):
    """Turns what ends a command into an exit code, before typer makes one code of all of it."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        with _swallowed_interrupts() as swallowed:
            done = self._invoke(ctx, swallowed)
            if swallowed:
                raise SystemExit(say("interrupted", INTERRUPTED))
            return done

    def _invoke(self, ctx: Any, swallowed: Sequence[object]) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise SystemExit(say("interrupted", INTERRUPTED)) from None
        except BrokenPipeError:
            # The reader of our output went away; Python would complain once more at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise SystemExit(NOT_DOCKED) from None
        except (MsrrError, OSError) as error:
            raise SystemExit(say(str(error), BAD_INPUT)) from None
        except Exception as error:
            if swallowed:  # and this may have stumbled over what was left undone
                raise SystemExit(say("interrupted", INTERRUPTED)) from None
            if hasattr(error, "exit_code"):  # typer's own: usage errors, and the end of a command
                raise
            traceback.print_exc()
            text = "this is an error of the program; please report it with the lines above"
            raise SystemExit(say(text, PROGRAM_ERROR)) from None


@contextmanager
def _swallowed_interrupts() -> Iterator[Sequence[object]]:
    """List the interrupts that a callback from C could not raise, and have each come again a little later.

    numba's compiler calls back from C; Python can only report what is raised there, and goes on.
    """
    again: list[threading.Timer] = []
    report = sys.unraisablehook

    def note(unraisable: UnraisableHookArgs) -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            report(unraisable)
            return
        again.append(threading.Timer(_AGAIN_S, _thread.interrupt_main))
        again[-1].daemon = True
        again[-1].start()

    sys.unraisablehook = note
    try:
        yield again
    finally:
        sys.unraisablehook = report
        for timer in again:
            timer.cancel()


def say(message: str, code: int) -> int:
    """Write a message to standard error and return ``code``."""
    print(f"msrr: {message}", file=sys.stderr)  # noqa: T201 - plain text, no markup
    return code
