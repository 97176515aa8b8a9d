"""The page docs/results/results.md names sweeps that can be run, and its script writes what they find."""

from __future__ import annotations

import re
import shlex
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import pytest

from msrr_bullet.cli.options import parse_seeds
from msrr_bullet.sweep.summary import SweepSummary
from msrr_bullet.sweep.sweep import run_sweep
from msrr_scenes.loading import load_scene
from tests.conftest import load_script

ROOT = Path(__file__).resolve().parents[1]


def swept(scene: str, trials: int) -> SweepSummary:
    """Return the summary of trials without contact and pixels."""
    points = load_scene(scene, {"plant": "unicycle", "perception": "parametric"})
    with ThreadPoolExecutor(1) as executor:  # starts faster than a process
        return run_sweep(points, range(trials), executor=executor)


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return load_script(ROOT / "docs" / "make_results.py")


def test_every_sweep_of_the_page_can_be_run_and_every_table_has_figures(script: ModuleType) -> None:
    rows = list(script.rows(script.PAGE.read_text()))
    assert len(rows) > 50
    for row in rows:
        assert "ends" in row.columns, row.command
        assert len(row.cells) == len(row.columns), row.command
        assert set(row.columns) <= {"", "command", "eight units build", "what happens", *script.FIGURES}
        assert re.fullmatch("-|`[0-9a-f]{8}`", row.cells[row.columns.index("code")]), row.command
        _, _, scene, *words = shlex.split(row.command)
        given: dict[str, list[str]] = {"--seeds": [], "--set": []}
        for option, value in zip(words[::2], words[1::2], strict=True):
            given[option].append(value)
        load_scene(scene, dict(text.split("=", 1) for text in given["--set"]))
        assert len(parse_seeds(*given["--seeds"])) >= 4


def test_a_row_gets_the_figures_of_its_columns_and_keeps_the_rest(script: ModuleType) -> None:
    columns = ("what", "command", "ends", "lateral / yaw error at contact, at most", "closest, m")
    head = f"| {' | '.join(columns)} |\n|---|---|---|---|---|\n"
    summary = swept("close_range", 2)
    (row,) = script.rows(head + "| it docks | `msrr sweep close_range --seeds 0:2` | - | - | - |\n")
    label, command, ends, errors, closest = row.filled(summary)[2:-2].split(" | ")
    (step,) = summary.steps
    assert (label, command) == ("it docks", "`msrr sweep close_range --seeds 0:2`")
    assert ends == "2 of 2 docked"
    lateral, yaw = (float(text.split()[0]) for text in errors.split(" / "))
    assert lateral == pytest.approx(step.contact_lateral_mm.max, abs=0.051)
    assert yaw == pytest.approx(step.contact_yaw_deg.max, abs=0.0051)
    assert float(closest) == pytest.approx(summary.min_clearance_m, abs=0.00051)
    late = [step.model_copy(update={"docked_by_attempt": {1: 1, 2: 1}})]
    assert script.ends(summary.model_copy(update={"steps": late})).endswith(
        ", 1 of them on the second attempt"
    )
    assert script.ends(summary.model_copy(update={"steps": 2 * late})).endswith(
        ", 2 of 4 docks on the second attempt"
    )


@pytest.mark.nightly
def test_missions_are_told_with_their_docks_and_plans_with_late_attempts(script: ModuleType) -> None:
    assert script.ends(swept("one_port", 1)) == "1 of 1 incomplete, 1 of 1 docks"
    again = swept("dock_again", 1)
    second = script.FIGURES["lateral / yaw error at the second contact, 95 %"](again)
    assert second.split(" mm")[0] == f"{again.mission.docks_again.contact_lateral_mm.p95:.1f}"
    late = swept("close_range_forced_retry", 2)
    assert script.ends(late) == "2 of 2 docked, on the second attempt"
