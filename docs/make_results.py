"""The figures of docs/results/results.md: runs the sweeps that its tables name, and writes what they find.

python docs/make_results.py            runs every sweep of the page, an hour on two cores
python docs/make_results.py blocked    runs those whose commands contain one of these words

What is stored in ``runs/sweeps.sqlite`` by the same code is not run again. Every row names the code that it
was run with, by the last commit that changed it.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from msrr_bullet.statistics import Quantiles
from msrr_bullet.sweep.summary import StepFigures, SweepSummary
from msrr_scenes.outcome import Outcome

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "results" / "results.md"

#: What the figures can depend on.
CODE = ("msrr_bullet", "perception", "control", "scenes", "urdf", "pyproject.toml", "constraints.txt")

#: Ends of which the page says that no trial has them.
NEVER = (Outcome.COLLISION, Outcome.CLEARANCE_VIOLATED, Outcome.FALSE_DOCK, Outcome.FALSE_ABORT)

_COMMAND = re.compile(r"`(msrr sweep [^`]+)`")
Docks = Callable[[SweepSummary], Sequence[StepFigures]]
_ORDINALS = {2: "second", 3: "third"}


class Row(NamedTuple):
    """A row of a table whose figures a sweep prints.

    Attributes:
        line: Index of its line in the page.
        columns: Headings of the table.
        cells: What stands below them.
        command: The sweep.
    """

    line: int
    columns: tuple[str, ...]
    cells: tuple[str, ...]
    command: str

    def filled(self, summary: SweepSummary) -> str:
        """Return the line with the figures of a summary."""
        figures = [FIGURES.get(column) for column in self.columns]
        cells = [
            cell if figure is None else figure(summary)
            for cell, figure in zip(self.cells, figures, strict=True)
        ]
        return f"| {' | '.join(cells)} |"


def rows(page: str) -> Iterator[Row]:
    """Yield the rows of the page that name a sweep, from top to bottom."""
    lines = page.splitlines()
    columns: tuple[str, ...] = ()
    for index, line in enumerate(lines):
        if not line.startswith("|"):
            continue
        if index + 1 < len(lines) and lines[index + 1].startswith("|---"):
            columns = _cells(line)
        elif found := _COMMAND.search(line):
            yield Row(index, columns, _cells(line), found[1])


def _cells(line: str) -> tuple[str, ...]:
    return tuple(cell.strip() for cell in line.strip().strip("|").split("|"))


def ends(summary: SweepSummary) -> str:
    """Return how the trials ended, the docks of missions, and how many plans took more than one attempt."""
    begun = [f"{count} of {summary.trials} {outcome}" for outcome, count in summary.outcomes.items()]
    parts = begun + ([f"{len(summary.failures)} failed"] if summary.failures else [])
    if summary.mission is not None and summary.mission.docks.trials:
        docks = summary.mission.docks
        parts.append(f"{docks.outcomes.get(Outcome.DOCKED.value, 0)} of {docks.trials} docks")
    attempts = sum((Counter(step.docked_by_attempt) for step in summary.steps), Counter[int]())
    for attempt, count in sorted(attempts.items()):
        if attempt > 1:
            who = "" if count == summary.trials else f"{count} of them "
            who = who if len(summary.steps) == 1 else f"{count} of {attempts.total()} docks "
            parts.append(f"{who}on the {_ORDINALS.get(attempt, f'{attempt}th')} attempt")
    return ", ".join(parts)


def _all_docks(summary: SweepSummary) -> Sequence[StepFigures]:
    return summary.steps if summary.mission is None else (summary.mission.docks,)


def _docks_again(summary: SweepSummary) -> Sequence[StepFigures]:
    """Return the figures of docks at a port where the same unit had docked before."""
    return () if summary.mission is None else (summary.mission.docks_again,)


def _errors(docks: Docks, of: Callable[[Quantiles], float | None]) -> Callable[[SweepSummary], str]:
    """Return what writes lateral and yaw error at contact; of a plan with more than one dock, the largest."""

    def errors(summary: SweepSummary) -> str:
        lateral = [v for step in docks(summary) if (v := of(step.contact_lateral_mm)) is not None]
        yaw = [v for step in docks(summary) if (v := of(step.contact_yaw_deg)) is not None]
        if not lateral or not yaw:
            return "-"
        return f"{max(lateral):.{1 if max(lateral) >= 1.0 else 2}f} mm / {max(yaw):.2f} deg"

    return errors


def _closest(summary: SweepSummary) -> str:
    return "-" if summary.min_clearance_m is None else f"{summary.min_clearance_m:.3f}"


def _last_lock(summary: SweepSummary) -> str:
    median = None if summary.mission is None else summary.mission.makespan_s.p50
    return "-" if median is None else f"{median:.1f} s"


def _parallel(summary: SweepSummary) -> str:
    median = None if summary.mission is None else summary.mission.parallel_percent.p50
    return "-" if median is None else f"{median:.0f} %"


def commit() -> str:
    """Return the last commit that changed the code.

    Raises:
        SystemExit: The code has changes that are not committed.
    """
    changed = _git("status", "--porcelain", "--", *CODE)
    if changed:
        raise SystemExit(f"commit these changes first, so that the page can name the code:\n{changed}")
    return _git("log", "-1", "--format=%h", "--abbrev=8", "--", *CODE)


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, stdout=subprocess.PIPE, check=True, text=True)
    return done.stdout.strip()


#: What the columns of figures say, by their heading; other columns are the writer's.
FIGURES: dict[str, Callable[[SweepSummary], str]] = {
    "ends": ends,
    "lateral / yaw error at contact, 95 %": _errors(_all_docks, lambda q: q.p95),
    "lateral / yaw error at contact, at most": _errors(_all_docks, lambda q: q.max),
    "lateral / yaw error at the second contact, 95 %": _errors(_docks_again, lambda q: q.p95),
    "closest, m": _closest,
    "last lock, median": _last_lock,
    "two or more under way": _parallel,
    "code": lambda _: f"`{commit()}`",
}


def swept(command: str) -> SweepSummary:
    """Run a sweep and return its summary; what it prints goes to the terminal."""
    words = shlex.split(command)
    done = subprocess.run(
        [sys.executable, "-m", "msrr_bullet", *words[1:], "--json", "-"], stdout=subprocess.PIPE, check=True
    )
    return SweepSummary.model_validate_json(done.stdout)


def main() -> str | None:
    """Run the sweeps, and write their figures into the page after each of them."""
    wrong = []
    commit()
    for row in rows(PAGE.read_text()):
        if sys.argv[1:] and not any(word in row.command for word in sys.argv[1:]):
            continue
        summary = swept(row.command)
        lines = PAGE.read_text().split("\n")
        old, lines[row.line] = lines[row.line], row.filled(summary)
        PAGE.write_text("\n".join(lines))
        if old != lines[row.line]:
            print(f"- {old}\n+ {lines[row.line]}", flush=True)
        bad = [outcome.value for outcome in NEVER if outcome.value in summary.outcomes]
        wrong += [f"{row.command}: {', '.join(bad)}"] if bad or summary.false_docks else []
    return "\n".join(wrong) or None


if __name__ == "__main__":
    sys.exit(main())
