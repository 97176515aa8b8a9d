"""The reference of the command line: the help of every command."""

from __future__ import annotations

import os
from contextlib import redirect_stdout
from io import StringIO

from msrr_bullet.cli import exit_codes
from msrr_bullet.cli.app import program, run

_HEAD = f"""\
# Command line

## Exit codes
| code | meaning |
| --- | --- |
| 0 | The command did what was asked; a trial ended `docked` or `complete`. |
| {exit_codes.NOT_DOCKED} | A trial ended with another outcome; a replay differs from its log, \
or the log ends early; a trial costs much more than `msrr bench --against` allows; the reader of \
the output has gone away, such as `head`. |
| {exit_codes.BAD_INPUT} | Arguments are wrong, a scene or a file cannot be used, a class of your own \
failed, or a trial took too long on the wall clock. |
| {exit_codes.PROGRAM_ERROR} | There is an error in the program itself. |
| {exit_codes.INTERRUPTED} | The command was interrupted by Ctrl-C. |
| 143 | It was ended by SIGTERM; by another signal, 128 and the number of the signal. |
"""

#: Width of the help [characters].
_WIDTH = "100"


def command_names() -> list[str]:
    """Return the names of all commands, in the order of the program's help."""
    return list(program().commands)


def commands_page() -> str:
    """Return the page of all commands."""
    helps = {name: _printed([name, "--help"]) for name in command_names()}
    sections = [f"\n## msrr {name}\n\n```text\n{text}\n```\n" for name, text in helps.items()]
    return _HEAD + "".join(sections)


def _printed(arguments: list[str]) -> str:
    """Return what the program prints, without the empty lines at its ends."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = _WIDTH
    try:
        with redirect_stdout(StringIO()) as printed:
            run(arguments)
    finally:
        if before is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = before
    return "\n".join(line.rstrip() for line in printed.getvalue().strip("\n").splitlines())
