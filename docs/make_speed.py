"""The page of speeds: the comparisons that ``msrr bench`` has written, as Markdown with figures.

python docs/make_speed.py
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from msrr_bullet.bench.speed_comparison import (
    SpeedComparison,
    draw_comparison,
    read_comparison,
    stage_rows,
    summary_rows,
)

RESULTS = Path(__file__).resolve().parent / "results"

#: What is compared: the name of the file, a heading and the options of ``msrr bench`` that made it.
COMPARED = (
    ("close_range", "Docking from 0.7 m", "close_range --grade perfect --grade careful"),
    ("two_units", "The way around an obstacle, and docking", "two_units --grade perfect --grade careful"),
    ("assemble_cross", "Eight units that build a cross", "assemble_cross --grade perfect --grade careful"),
    ("units", "By the number of units, built with care", "sixteen --units 2 --units 4 --units 8 --units 16"),
)

INTRODUCTION = """\
# What a simulated second costs

{machine}, of which one is used; Python {python}, PyBullet {pybullet}, NumPy {numpy}. Times are wall clock per
simulated second of one trial, log and viewer off, each in a process of its own: the fastest of three runs
after a first one. *Physics alone* is the same world with the same commands, and nothing that senses or
decides: the ratio to it says more about another machine than milliseconds do. *Calls of functions* counts
those from Python, of which every run with the same versions has nearly as many, however busy the machine is.
The tables are of one day, on which nothing else ran on this machine; where other programs share it,
milliseconds have been four times as many, and *over physics within it* up to a seventh more. `make bench`
measures the first table and four units of the last one again, and fails if a trial costs much more over the
physics within it than here, or calls a twentieth more functions. This page is made of the files that the
commands below write, by `python docs/make_speed.py`.

The overhead camera has 1280 x 960 pixels at 10 Hz, the camera of a docking unit 640 x 480 at 25 Hz. Units
of the [grade](../explanation/as_built.md) *careful* have lenses that distort and cameras that expose for 10
ms. *Real time factor* is simulated time over wall clock, *over physics alone* the ratio of *in all* to
*physics alone*, and *over physics within it* that to the row *physics*, which other programs change least.
"""


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table, numbers to the right."""
    rule = ["---", *["---:"] * (len(columns) - 1)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (columns, rule, *rows)) + "\n"


def section(name: str, heading: str, options: str) -> str:
    """Return the section of a comparison."""
    found = comparison(name)
    rows = [*stage_rows(found), *summary_rows(found)]
    return "\n".join(
        [
            f"## {heading}",
            f"`msrr bench {options} --json docs/results/speed/{name}.json`",
            "",
            table(["per simulated second", *found.variants], rows),
            f"![Stages of the loop, and physics alone, as bars](speed/{name}.png)",
            "",
        ]
    )


def comparison(name: str) -> SpeedComparison:
    """Return a comparison of :data:`COMPARED`."""
    return read_comparison(RESULTS / "speed" / f"{name}.json")


def page() -> str:
    """Return the page; machine and versions are those of the first comparison."""
    first = comparison(COMPARED[0][0])
    introduction = INTRODUCTION.format(machine=first.machine, **first.versions)
    return "\n".join([introduction, *(section(*compared) for compared in COMPARED)])


def main() -> None:
    """Write the page and its figures."""
    for name, *_ in COMPARED:
        draw_comparison(comparison(name), RESULTS / "speed" / f"{name}.png")
    (RESULTS / "speed.md").write_text(page())


if __name__ == "__main__":
    sys.exit(main())
