"""The tables of docs/results/detection.md, of what ``msrr bench detection`` has measured.

msrr bench detection --json runs/detection.json
python docs/make_detection.py runs/detection.json
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from msrr_bullet.bench.detection_benchmark import DetectionBenchmark
from msrr_bullet.bench.detection_metrics import DetectionRow

PAGE = Path(__file__).resolve().parent / "results" / "detection.md"


def onboard_rows(found: DetectionBenchmark) -> Iterator[str]:
    """Yield the lines of the table below ``## Onboard``."""
    for plain, hard in zip(found.onboard.rows, found.onboard_hard.rows, strict=True):
        large = _px(plain.rms_large_px)
        yield _line(
            plain.settings,
            *(_recall(plain), f"{plain.tags:.2f}", _px(plain.rms_px), large),
            *(*_cost(plain), _recall(hard), _px(hard.rms_px), f"{hard.ms:.2f}"),
        )


def overhead_rows(found: DetectionBenchmark) -> Iterator[str]:
    """Yield the lines of the table below ``## Overhead``."""
    for plain, hard in zip(found.overhead.rows, found.overhead_hard.rows, strict=True):
        easy = (_recall(plain), f"{plain.tags:.2f}", _px(plain.rms_px), *_cost(plain))
        yield _line(
            plain.settings, *easy, f"{100.0 * hard.recall.rate:.1f}", _px(hard.rms_px), f"{hard.ms:.2f}"
        )


def page(text: str, found: DetectionBenchmark) -> str:
    """Return the page with the tables of a report."""
    text = _with_rows(text, "## Onboard", onboard_rows(found))
    return _with_rows(text, "## Overhead", overhead_rows(found))


def _with_rows(text: str, heading: str, rows: Iterator[str]) -> str:
    """Return a page with other rows in the table below a heading, which follow its two lines of columns."""
    before, rest = text.split(f"\n{heading}\n")
    columns, rule, *lines = rest.split("\n")
    after = lines[lines.index("") :]
    return "\n".join([before, heading, columns, rule, *rows, *after])


def _recall(row: DetectionRow) -> str:
    rate = row.recall
    return f"{100.0 * rate.rate:.1f} ({100.0 * rate.low:.1f}..{100.0 * rate.high:.1f})"


def _cost(row: DetectionRow) -> tuple[str, str, str]:
    """Return errors of the pose, pixels and time."""
    pose = ", ".join("-" if q is None else f"{q:.3g}" for q in (row.distance_mm.p50, row.distance_mm.p95))
    return pose, f"{1e-3 * row.pixels:.1f}", f"{row.ms:.2f}"


def _px(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def main(report: Annotated[Path, typer.Argument(exists=True, dir_okay=False)]) -> None:
    """Write the tables of a report of msrr bench detection --json into the page."""
    found = DetectionBenchmark.model_validate_json(report.read_text())
    PAGE.write_text(page(PAGE.read_text(), found))


if __name__ == "__main__":
    typer.run(main)
