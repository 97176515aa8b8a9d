"""The reproduction: figures, words and files, on few trials."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.cli import run
from msrr_bullet.reproduce import unicycle_part
from msrr_bullet.reproduce.ablation_plot import draw_ablations
from msrr_bullet.reproduce.ablations import ablation_jobs, ablation_row
from msrr_bullet.reproduce.bullet_part import Experiment, reproduce_bullet, within_paper
from msrr_bullet.reproduce.close_studies import close_row, close_series
from msrr_bullet.reproduce.findings import ablation_text, claims, map_text, winner_text
from msrr_bullet.reproduce.gain_delay import LAWS, gain_delay_map
from msrr_bullet.reproduce.long_studies import long_row
from msrr_bullet.reproduce.measured_trial import MeasuredTrial, Shelf, measured_trial, record_trial
from msrr_bullet.reproduce.measures import MEASURES, measure
from msrr_bullet.reproduce.model import Measured, Reproduction
from msrr_bullet.reproduce.run import joined, write_all
from msrr_bullet.reproduce.settings import HARD, HIGH_GAIN, STANDARD
from msrr_scenes.errors import MsrrError
from msrr_scenes.load import load_scene
from msrr_scenes.spec import Choice

C1, C2 = Choice(name="c1"), Choice(name="c2")


@pytest.fixture(scope="module")
def unicycle() -> Reproduction:
    """A whole reproduction on unicycles with three trials and a map of four cells."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unicycle_part, "GAINS", (0.8, 6.0, 6.0, 6.0))
        patch.setattr(unicycle_part, "LATENCIES", (0.0, 0.1, 0.1, 0.1))
        patch.setattr(unicycle_part, "TABLES", (STANDARD, HARD))
        patch.setattr("msrr_bullet.reproduce.ablations.SETTINGS", (STANDARD,))
        patch.setattr(unicycle_part, "SETTINGS", (STANDARD,))
        contenders = {"long": {"C1": C1}, "close": {"C2": C2, "C1": C1, "CBF": Choice(name="cbf")}}
        return unicycle_part.reproduce_unicycle(range(3), contenders)


@pytest.mark.parametrize("phase", ["long", "close"])
def test_c1_meets_what_is_asked_of_it(phase) -> None:
    """100 trials at a fixed seed: no chance is involved, and the bounds leave a tenth of room or more."""
    row = (long_row if phase == "long" else close_row)(C1, "C1", STANDARD, range(100))
    for what in MEASURES[phase]:
        if what.asked_p50 is None or what.asked_p95 is None:
            continue
        q = row.measures[what.key].quantiles
        assert q.p50 is not None
        assert q.p50 <= what.asked_p50, what.key
        assert q.p95 is not None
        assert q.p95 <= what.asked_p95, what.key
    assert row.success.rate == 1.0
    assert row.within_paper == 100


def test_an_ablation_switches_one_part_off_and_keeps_the_setting() -> None:
    jobs = {(j[0], j[1]): j for j in ablation_jobs(range(20)) if j[2] is HIGH_GAIN}
    with_it, without = (
        ablation_row(jobs["close", label]).success.rate for label in ("C1", "without anti-windup")
    )
    assert with_it > 0.9 > 0.6 > without
    assert ablation_row(jobs["long", "without envelope"]).success.rate == 0.0


def test_the_map_has_both_regions() -> None:
    found = gain_delay_map(False, range(12), map, gains=(0.8, 6.0), latencies=(0.0, 0.1))
    gentle = [found.cells[law][0][0].success for law in LAWS]
    fierce = [found.cells[law][1][1].success for law in LAWS]
    assert gentle == [1.0, 1.0]
    assert fierce[0] > 0.9 > 0.5 > fierce[1]
    assert found.paper_cell == (6.0, 0.1)


def test_a_trial_over_time_ends_at_the_face() -> None:
    one = close_series(C1, STANDARD, 3)
    assert one.tip[-1][0] == pytest.approx(0.0, abs=0.004)
    assert abs(one.error[-1][1]) < 0.01
    assert len({len(x) for x in (one.time, one.tip, one.reference, one.command, one.twist, one.angles)}) == 1
    assert set(one.auxiliary) == {"xi", "cone shift [m]"}


def test_a_figure_that_no_trial_has_is_no_number() -> None:
    none = Measured.of([math.nan, math.nan])
    assert none.count == 0
    assert none.quantiles.p50 is None


def test_report_figures_and_json(unicycle: Reproduction, tmp_path: Path) -> None:
    report = write_all(unicycle, tmp_path)
    text = report.read_text()
    pictures = sorted(tmp_path.glob("*.png"))
    assert text.count("data:image/png;base64,") == len(pictures) > 8
    assert 'src="http' not in text
    for picture in pictures:
        assert picture.read_bytes().startswith(b"\x89PNG")
    data = json.loads((tmp_path / "reproduction.json").read_text())
    assert Reproduction.model_validate(data) == unicycle
    again = draw_ablations(unicycle.ablations[0], tmp_path / "again.png")
    assert again.read_bytes() == (tmp_path / "ablations-long.png").read_bytes()


def test_what_is_said_is_read_from_the_findings(unicycle: Reproduction) -> None:
    said = claims(unicycle)
    assert sum("C1, unicycle" in c.text for c in said) == 5
    table = unicycle.table("close", "unicycle", "standard")
    assert table is not None
    final = table.rows[1].measures["final"].quantiles.p95
    assert any(final is not None and f"/ {1e3 * final:.3g} mm" in c.found for c in said)
    assert "CBF" in winner_text(unicycle)
    assert "Without delay compensation" in map_text(unicycle)
    assert "envelope: 100 points of passing the obstacle (standard)" in ablation_text(unicycle.ablations[0])
    assert winner_text(Reproduction(versions={}, seeds={})) == ""


def test_trials_of_the_real_loop_are_measured(blind_loop: dict[str, str]) -> None:
    scene = load_scene("two_units", {**blind_loop, "control.assembly": "c1"})
    result, long, close = record_trial(scene, 1)
    assert result.docked
    assert long is not None
    assert close is not None
    assert long.measures()["tracking"] < 0.05
    measures = close.measures(0.015)
    assert measures["final"] < 0.01
    # The guidance worked out again ends beyond the face and starts beside the tip.
    assert abs(close.reference[0, 0] - close.tip[0, 0]) < 0.02
    assert np.all(np.diff(close.reference[:, 0]) >= -1e-12)
    assert close.kept_within(scene.los.outer)


def test_stopped_runs_resume(blind_loop: dict[str, str], tmp_path: Path) -> None:
    experiment = Experiment(
        "short", "close_range", "for the test", ("close",), {"C1": C1}, overrides=blind_loop
    )
    first = measured_trial(experiment.load("C1"), 0)
    shelf = Shelf(tmp_path, experiment.load("C1"))
    shelf.put(first)
    with shelf.path.open("a") as file:
        file.write('{"half a li')  # what a kill leaves
    told: list[str] = []
    both = reproduce_bullet([experiment], range(2), tmp_path, tell=told.append)
    assert told[0] == "short, C1: 1 of 2 (1 of all 2)"
    assert told[-1] == "short, C1: 2 of 2 (2 of all 2, about 0 s left)"
    row = both.tables[0].rows[0]
    assert (row.trials, row.outcomes, row.within_paper) == (2, {"docked": 2}, 2)
    assert row.measures["final"].values[0] == pytest.approx(first.measures["final"], abs=1e-6)
    with shelf.path.open("a") as file:
        file.write("not a trial\n")
    with pytest.raises(MsrrError, match="not a measured trial"):
        list(Shelf(tmp_path, experiment.load("C1")))
    assert len(joined([both, both]).tables) == 2


def test_the_papers_figures_decide(blind_loop: dict[str, str]) -> None:
    trial = measured_trial(load_scene("close_range", blind_loop), 0)
    assert isinstance(trial, MeasuredTrial)
    assert within_paper(trial, ("close",))
    late = trial.model_copy(update={"measures": {**trial.measures, "settling": 4.1}})
    assert not within_paper(late, ("close",))
    assert not within_paper(trial, ("long", "close"))  # it has no long phase
    assert measure("settling").paper_c1 == 4.0


@pytest.fixture
def blind_loop() -> dict[str, str]:
    """Contact and pixels by their models: a trial of the loop in a fraction of a second."""
    return {"plant": "unicycle", "perception": "parametric"}


def test_the_command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys, unicycle: Reproduction) -> None:
    asked = {}

    def quick(out: Path, **given) -> Reproduction:
        asked.update(given, out=out)
        return unicycle

    monkeypatch.setattr("msrr_bullet.reproduce.run.reproduce", quick)
    assert run(["reproduce", "--plant", "both", "--seeds", "3:7", "--out", str(tmp_path)]) == 0
    assert asked["unicycle"] == asked["bullet"] == range(3, 7)
    assert "C1, unicycle" in capsys.readouterr().out
    assert run(["reproduce", "--out", str(tmp_path)]) == 0
    assert (asked["unicycle"], asked["bullet"]) == (range(200), None)
    assert run(["reproduce", "--seeds", "x"]) == 2
