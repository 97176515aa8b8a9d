"""The command ``msrr compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from msrr_bullet.cli.console import open_console
from msrr_bullet.cli.options import STANDARD_OUTPUT, JsonFile, check_writable, write_output


def compare(
    first: Annotated[Path, typer.Argument(metavar="FIRST.csv", help="Table by msrr sweep --csv.")],
    second: Annotated[Path, typer.Argument(metavar="SECOND.csv", help="Table of another sweep.")],
    json_file: JsonFile = None,
) -> None:
    """Compare two sweeps over the same seeds, trial by trial.

    What the trials share, such as the start and the robots, cancels out.
    """
    from msrr_bullet.cli.console_report import comparison_table
    from msrr_bullet.sweep.comparison import compare_sweeps

    check_writable(json_file, taken=[first, second])
    comparison = compare_sweeps(first, second)
    names = (first.stem, second.stem) if first.stem != second.stem else (str(first), str(second))
    table = comparison_table(comparison, *names)
    write_output(json_file, comparison.model_dump_json(indent=2) + "\n")
    open_console(stderr=json_file == STANDARD_OUTPUT).print(table)
