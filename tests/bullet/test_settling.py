"""When a trial counts as settled: the same on both plants, and quantiles do not forget who never was."""

import math
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.reproduce.bullet_part import Experiment, reproduce_bullet
from msrr_bullet.reproduce.measured_trial import TrialCache, measured_trial
from msrr_bullet.reproduce.report.ablation_findings import ablation_text
from msrr_bullet.reproduce.report.ablation_plot import draw_ablations
from msrr_bullet.reproduce.report.findings import claims
from msrr_bullet.reproduce.report.intervals import of_quantile
from msrr_bullet.reproduce.report.two_quantiles import two_quantiles
from msrr_bullet.reproduce.run import redraw, write_all
from msrr_bullet.reproduce.trial_series import CloseSeries
from msrr_bullet.studies.measures import measure
from msrr_bullet.studies.model import Ablations, Measured, Reproduction, Row, Table, met_of, rate_of
from msrr_bullet.studies.open_quantiles import quantile
from msrr_control.studies.docking_study import StudyResult
from msrr_scenes.loading.load import load_scene
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.spec import Choice

DT = 0.02


def _series(off: np.ndarray) -> CloseSeries:
    """An approach of the real loop whose tip is ``off`` beside the guidance."""
    steps = len(off)
    tip = np.stack([np.linspace(-0.5, 0.0, steps), off], axis=-1)
    reference = tip * [1.0, 0.0]
    return CloseSeries(
        time=DT * np.arange(steps),
        pose=np.zeros((steps, 3)),
        tip=tip,
        reference=reference,
        edges=np.zeros((steps, 2)),
        command=np.zeros((steps, 2)),
    )


def _study(off: np.ndarray, contact: int) -> StudyResult:
    """The same as one trial of a study."""
    steps = len(off)
    tip = np.stack([np.linspace(-0.5, 0.0, steps), off], axis=-1)[:, None]
    pairs = np.zeros((steps, 1, 2))
    return StudyResult(
        DT, np.zeros((steps, 1, 3)), pairs, pairs, pairs, tip, tip * [1.0, 0.0], np.array([contact]), 0
    )


def test_one_definition_for_both_plants() -> None:
    """Random errors, some of which end beyond the bound: the two rooms agree on every one of them."""
    rng = stream(5, "test/settling")
    never = 0
    for _ in range(60):
        off = np.abs(rng.normal(0.0, 0.03)) * np.exp(-DT * np.arange(100)) + rng.uniform(0.0, 0.02)
        found = _series(off).measures(0.015)
        # With the contact at the end, without one, and with one that more time comes after.
        for study in (_study(off, 99), _study(off, -1), _study(np.append(off, np.full(9, 0.5)), 99)):
            assert found["settling"] == pytest.approx(study.settling_time(0.015)[0])
            assert found["final"] == pytest.approx(study.final_error()[0])
        never += math.isinf(found["settling"])
    assert 10 < never < 50


def test_settled_is_who_stays_settled() -> None:
    off = np.full(100, 0.001)
    assert _series(off).measures(0.015)["settling"] == 0.0
    off[40] = 0.02
    assert _series(off).measures(0.015)["settling"] == pytest.approx(41 * DT)
    off[98] = 0.016
    assert _series(off).measures(0.015)["settling"] == pytest.approx(99 * DT)
    off[99] = 0.016
    assert _series(off).measures(0.015)["settling"] == math.inf
    assert _study(off, 99).settling_time(0.015)[0] == math.inf
    assert _study(off, 60).settling_time(0.015)[0] == pytest.approx(41 * DT)


def test_the_final_error_is_the_largest_of_the_last_second() -> None:
    off = np.full(101, 0.001)
    off[50] = 0.009  # a second before the end
    assert _series(off).measures(0.015)["final"] == pytest.approx(0.009)
    assert _series(off).measures(0.015, window_s=0.9)["final"] == pytest.approx(0.001)
    off[49] = 0.011  # before that
    assert _series(off).measures(0.015)["final"] == pytest.approx(0.009)
    assert _series(off).measures(0.015, window_s=1.1)["final"] == pytest.approx(0.011)


def test_quantiles_reach_into_those_who_never_settle() -> None:
    few, many = [1.0] * 19 + [math.inf], [1.0] * 10 + [math.inf] * 10
    assert [quantile(few, q) for q in (0.5, 0.94, 0.95, 1.0)] == [1.0, 1.0, math.inf, math.inf]
    assert quantile([1.0, 2.0, math.inf], 0.5) == 2.0
    assert [quantile(many, q) for q in (0.25, 0.5, 0.75)] == [1.0, math.inf, math.inf]
    values = list(stream(1, "test/quantile").uniform(size=37))
    assert quantile(values, 0.95) == np.quantile(values, 0.95)
    measured = Measured.of([*few, math.nan])
    assert (measured.count, measured.never) == (20, 1)
    assert (measured.quantiles.p50, measured.quantiles.p95) == (1.0, math.inf)
    assert Measured.model_validate_json(measured.model_dump_json()) == measured
    estimate = of_quantile(Measured.of(many), 0.5)
    assert estimate is not None
    assert (estimate.value, estimate.low, estimate.high) == (math.inf, 1.0, math.inf)
    # Who never settles does not meet the paper's 4 s; who has no such time is not asked.
    count = met_of({"settling": [1.0, 4.1, math.inf, math.nan]})["settling"]
    assert (count.n, count.of) == (1, 3)


def test_the_report_says_never_and_how_many(tmp_path: Path) -> None:
    def row(label: str, settling: list[float]) -> Row:
        other = {k: Measured.of([0.001] * 20) for k in ("final", "lateral", "yaw")}
        return Row(
            controller="c1",
            label=label,
            trials=20,
            success=rate_of(np.ones(20, dtype=bool)),
            in_view=rate_of(np.ones(20, dtype=bool)),
            in_cone=rate_of(np.ones(20, dtype=bool)),
            measures={"settling": Measured.of(settling), **other},
        )

    rows = (
        row("C1", [1.0] * 18 + [math.inf] * 2),
        row("without it", [math.inf] * 20),
        row("C2", [1.0] * 15 + [math.nan] * 5),
    )
    what = measure("settling")
    assert [two_quantiles(r, what) for r in rows] == [
        "1 / never (2 never)",
        "never / never (20 never)",
        "1 / 1 (n = 15)",
    ]
    table = Table(phase="close", plant="unicycle", setting="standard", description="", rows=rows)
    ablations = Ablations(phase="close", tables=(table,))
    found = Reproduction(versions={}, seeds={}, tables=(table,), ablations=(ablations,))
    report = write_all(found, tmp_path)
    text = report.read_text()
    assert "1 / never (2 never)" in text
    assert redraw(tmp_path).read_text() == text
    (said,) = [c for c in claims(found) if "15 mm" in c.text]
    assert (said.found, said.met) == ("1 / never s", False)
    (first, *_) = ablation_text(ablations)
    assert "nothing is worse" in first  # both may be infinite: the 95th percentiles cannot be told apart
    assert draw_ablations(ablations, tmp_path / "again.png").is_file()


def test_a_trial_that_never_settled_is_kept_and_counted(tmp_path: Path) -> None:
    experiment = Experiment(
        "short",
        "close_range",
        "",
        ("close",),
        {"C1": Choice(name="c1")},
        overrides={"plant": "unicycle", "perception": "parametric"},
    )
    scene = experiment.load("C1")
    trials = [measured_trial(scene, seed) for seed in (0, 1)]
    lost = trials[1].model_copy(update={"measures": {**trials[1].measures, "settling": math.inf}})
    shelf = TrialCache(tmp_path, scene)
    shelf.put(trials[0])
    shelf.put(lost)
    assert list(shelf) == [trials[0], lost]
    row = reproduce_bullet([experiment], range(2), tmp_path).tables[0].rows[0]
    settling = row.measures["settling"]
    assert (settling.count, settling.never, settling.quantiles.p95) == (2, 1, math.inf)
    assert (row.met["settling"].n, row.met["settling"].of) == (1, 2)
    assert row.within_paper == 1


def test_a_trial_without_an_approach_never_settled() -> None:
    quick = {"plant": "unicycle", "perception": "parametric", "time_limit_s": "1.0"}
    trial = measured_trial(load_scene("two_units", quick), 0)
    assert trial.kept_in_view is None
    assert trial.measures["settling"] == math.inf
    assert "final" not in trial.measures
