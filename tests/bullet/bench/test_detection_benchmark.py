"""The report of the detection benchmark: every setting in every case, tables and JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from rich.console import Console

from msrr_bullet.bench.detection_benchmark import (
    DetectionBenchmark,
    DetectionCase,
    benchmark_detection,
    detection_tables,
)
from msrr_bullet.bench.detection_metrics import DetectionRow
from msrr_bullet.bench.detector_settings import OURS
from msrr_bullet.cli.app import run
from msrr_bullet.cli.exit_codes import BAD_INPUT
from tests.conftest import load_script

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.fixture(scope="module")
def report() -> DetectionBenchmark:
    messages: list[str] = []
    result = benchmark_detection(views=1, arrangements=1, exposures=4, observer=messages.append)
    assert len(messages) == 4
    return result


def _ours(case: DetectionCase) -> DetectionRow:
    return next(row for row in case.rows if row.settings == OURS)


@pytest.mark.nightly
def test_every_case_has_all_settings(report: DetectionBenchmark) -> None:
    assert [row.settings for row in report.onboard.rows] == [r.settings for r in report.onboard_hard.rows]
    assert [row.settings for row in report.overhead.rows] == [r.settings for r in report.overhead_hard.rows]
    for case, exposures in zip(report.cases, (7, 7, 4, 4), strict=True):
        assert {row.exposures for row in case.rows} == {exposures}
        assert _ours(case).ms > 0.0


@pytest.mark.nightly
def test_the_page_shows_every_setting(report: DetectionBenchmark) -> None:
    """pyapriltags is compared only where it is installed; the page has it."""
    script = load_script(DOCS / "make_detection.py")
    stored = script.PAGE.read_text()
    made = script.page(stored, report)
    shown, named = ([line.split(" | ")[0] for line in page.splitlines()] for page in (made, stored))
    optional = "| ... pyapriltags"
    assert [line for line in shown if line != optional] == [line for line in named if line != optional]


@pytest.mark.nightly
def test_from_above_every_body_is_found_and_exact(report: DetectionBenchmark) -> None:
    ours = _ours(report.overhead)
    assert ours.recall.rate == 1.0
    assert ours.rms_px is not None
    assert ours.rms_px < 0.06
    assert ours.distance_mm.p95 is not None
    assert ours.distance_mm.p95 < 0.5


@pytest.mark.nightly
def test_tables_fit_a_terminal_and_json_holds_the_figures(report: DetectionBenchmark) -> None:
    console = Console(record=True, markup=False, width=80)
    for table in detection_tables(report):
        console.print(table)
    text = console.export_text()
    assert "…" not in text
    assert "[px]" in text
    for case in report.cases:
        for row in case.rows:
            assert row.settings in text
    assert f"{_ours(report.onboard).rms_px:.3f}" in text
    assert DetectionBenchmark.model_validate(json.loads(report.model_dump_json())) == report


def test_a_bench_without_a_scene_has_nothing_to_set(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["bench", "detection", "--set", "time_limit_s=1"]) == BAD_INPUT
    assert "apply to scenes only" in capsys.readouterr().err
