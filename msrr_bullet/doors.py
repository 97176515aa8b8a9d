"""How a command ends: one message for all that can be expected, and a telling exit code."""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

from typer.core import TyperGroup

from msrr_scenes.errors import MsrrError

NOT_DOCKED = 1
BAD_INPUT = 2
PROGRAM_ERROR = 70
INTERRUPTED = 130


class Doors(TyperGroup):
    """Turns what ends a command into an exit code, before typer makes one code of all of it."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        with _interrupts_noted() as interrupts:
            return self._invoke(ctx, interrupts)

    def _invoke(self, ctx: Any, interrupts: Sequence[int]) -> Any:
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
            if hasattr(error, "exit_code"):  # typer's own: usage errors, and the end of a command
                raise
            if interrupts:
                # A compiler's callback from C swallowed the interrupt, and its caller stumbled over the rest.
                raise SystemExit(say("interrupted", INTERRUPTED)) from None
            traceback.print_exc()
            text = "this is an error of the program; please report it with the lines above"
            raise SystemExit(say(text, PROGRAM_ERROR)) from None


@contextmanager
def _interrupts_noted() -> Iterator[list[int]]:
    """Note every SIGINT before it is raised: raised inside a callback from C it is lost."""
    noted: list[int] = []

    def note_and_raise(number: int, frame: FrameType | None) -> None:
        noted.append(number)
        signal.default_int_handler(number, frame)

    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    # Only the main thread may set handlers, and only there do signals arrive.
    if not ours or threading.current_thread() is not threading.main_thread():
        yield noted
        return
    signal.signal(signal.SIGINT, note_and_raise)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def say(message: str, code: int) -> int:
    """Write a message to standard error and return ``code``."""
    print(f"msrr: {message}", file=sys.stderr)  # noqa: T201 - plain text, no markup
    return code
