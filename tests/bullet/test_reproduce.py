"""The reproduction: figures, words and files, on few trials."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.reproduce import unicycle_part
from msrr_bullet.reproduce.bullet_part import Experiment, meets, reproduce_bullet, within_paper
from msrr_bullet.reproduce.forecast import Forecast
from msrr_bullet.reproduce.measured_trial import MeasuredTrial, TrialCache, measured_trial, record_trial
from msrr_bullet.reproduce.report.ablation_findings import ablation_text
from msrr_bullet.reproduce.report.ablation_plot import draw_ablations
from msrr_bullet.reproduce.report.findings import claims, map_text, winner_text
from msrr_bullet.reproduce.report.intervals import quantile_interval
from msrr_bullet.reproduce.report.lag_findings import lag_text
from msrr_bullet.reproduce.run import joined, redraw, write_all
from msrr_bullet.reproduce.trial_series import CloseSeries, SeriesRecorder
from msrr_bullet.studies.ablations import ablation_jobs, ablation_row
from msrr_bullet.studies.close_studies import close_row, close_series
from msrr_bullet.studies.gain_delay import LAWS, gain_delay_map
from msrr_bullet.studies.long_studies import long_row
from msrr_bullet.studies.measures import MEASURES, measure
from msrr_bullet.studies.model import Ablations, GainDelayMap, MapCell, Measured, Reproduction, Table
from msrr_bullet.studies.settings import HARD, HIGH_GAIN, STANDARD
from msrr_bullet.timeline.path_following_series import PathFollowingSeries
from msrr_bullet.trial.trial import Trial
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Phase, seconds
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.spec import Choice

C1, C2 = Choice(name="c1"), Choice(name="c2")


@pytest.fixture(scope="module")
def unicycle() -> Reproduction:
    """A whole reproduction on unicycles with three trials and a map of four cells."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unicycle_part, "GAINS", (0.8, 6.0, 6.0, 6.0))
        patch.setattr(unicycle_part, "LATENCIES", (0.0, 0.1, 0.1, 0.1))
        patch.setattr(unicycle_part, "TABLES", (STANDARD, HARD))
        patch.setattr("msrr_bullet.studies.ablations.SETTINGS", (STANDARD,))
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


def test_the_text_of_the_map_names_gaps() -> None:
    good, bad = MapCell(success=1.0, final_p50_m=0.01), MapCell(success=0.5, final_p50_m=0.04)
    chart = GainDelayMap(
        compensated=True,
        gains=(1.0, 2.0, 3.0),
        latencies=(0.0, 0.1, 0.2),
        lag=0.05,
        extra_gain=2.0,
        trials=20,
        cells={"c1": ((good,) * 3,) * 3, "c2": ((good,) * 3, (good, bad, good), (good, bad, bad))},
        paper_cell=(1.0, 0.0),
    )
    (said,) = map_text(Reproduction(versions={}, seeds={}, maps=(chart,)))
    both = (
        "Both dock at k_n = 1 1/s and 50 to 250 ms; k_n = 2 1/s and 50 ms and 250 ms; k_n = 3 1/s and 50 ms."
    )
    assert both in said
    assert "C1 alone docks at k_n = 2 1/s and 150 ms; k_n = 3 1/s and 150 to 250 ms." in said


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
    with pytest.raises(MsrrError, match=r"reproduction\.json"):
        redraw(tmp_path / "elsewhere")
    assert redraw(tmp_path).read_text() == text
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
    assert "Without delay compensation" in map_text(unicycle)[0]
    assert winner_text(Reproduction(versions={}, seeds={})) == ""


def test_an_ablation_is_told_with_its_intervals() -> None:
    jobs = [j for j in ablation_jobs(range(20)) if j[0] == "long" and j[2] is STANDARD]
    rows = tuple(ablation_row(j) for j in jobs if j[1] in ("C1", "without envelope"))
    table = Table(phase="long", plant="unicycle", setting="standard", description="", rows=rows)
    (said,) = ablation_text(Ablations(phase="long", tables=(table,)))
    # 0 and 20 of 20, with Wilson's bounds; what drives through the obstacle has no other figures.
    assert said == (
        "C1 without envelope: clear of the obstacle 0.0 % (0.0 .. 16.1) instead of 100.0 % (83.9 .. 100.0)"
        " (standard)."
    )


def test_a_quantile_lies_between_two_order_statistics() -> None:
    values = list(range(1, 201))
    low, high = quantile_interval(values, 0.95)
    # Binomial (200, 0.95): P(X <= 183) = 0.0238, P(X <= 184) = 0.0444; P(X >= 197) = 0.0090,
    # P(X >= 196) = 0.0264.
    assert (low, high) == (184.0, 197.0)
    assert quantile_interval([1.0, 2.0, 3.0], 0.95) == (2.0, math.inf)
    rng = stream(4, "test/quantiles")
    inside = 0
    for _ in range(400):
        low, high = quantile_interval(list(rng.uniform(size=60)), 0.5)
        inside += low <= 0.5 <= high
    # At least 95 % by construction; 400 trials at a fixed seed, 0.92 is 2.8 standard deviations below.
    assert inside >= 0.92 * 400


def test_what_is_left_is_estimated_by_kind() -> None:
    now = [0.0]
    forecast = Forecast({"long": (4, 3.0), "short": (10, 1.0)}, clock=lambda: now[0])
    assert str(forecast) == "0 of all 14"
    forecast.kept("long", 2)
    now[0] = 60.0
    forecast.ran("long")
    # One of the long ones and ten that take a third of it.
    assert forecast.seconds_left == pytest.approx(60.0 + 10 * 20.0)
    assert str(forecast) == "3 of all 14, about 4 min left"
    now[0] = 70.0
    forecast.ran("short")
    assert forecast.seconds_left == pytest.approx(60.0 + 9 * 10.0)


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


@pytest.mark.parametrize("law", ["c1", "c2"])
def test_the_long_phase_of_the_loop_tells_lag_from_swing(blind_loop: dict[str, str], law: str) -> None:
    _, long, _ = record_trial(load_scene("two_units", {**blind_loop, "control.assembly": law}), 1)
    assert long is not None
    off, beside = np.hypot(*(long.tip - long.desired).T), long.from_path()
    assert np.all(beside <= off + 1e-12)
    found = long.measures()
    lag = found["amplitude"] - found["amplitude_path"]
    assert (0.0 <= lag < 0.003) if law == "c1" else (lag > 0.01)
    assert 0.0 < found["recovery_path"] <= found["recovery"]


def test_each_path_of_the_loop_counts_for_itself() -> None:
    """A new path a metre beside the old one, which the unit was on all the time."""
    x = np.linspace(0.0, 1.0, 20)
    old, new = np.stack([x, np.zeros(20)], axis=-1), np.stack([x, np.ones(20)], axis=-1)
    series = PathFollowingSeries(
        time=0.02 * np.arange(40),
        pose=np.zeros((40, 3)),
        tip=np.concatenate([old, old]),
        desired=np.concatenate([old, new]),
        command=np.zeros((40, 2)),
        path=np.repeat([1, 2], 20),
        walled=np.zeros(40, dtype=bool),
        arc_end=math.nan,
    )
    np.testing.assert_allclose(series.from_path(), np.repeat([0.0, 1.0], 20), atol=1e-12)


def test_both_distances_stand_beside_each_other_in_the_report(tmp_path: Path) -> None:
    rows = tuple(long_row(choice, choice.name.upper(), STANDARD, range(40)) for choice in (C1, C2))
    table = Table(phase="long", plant="unicycle", setting="standard", description="here", rows=rows)
    found = Reproduction(versions={}, seeds={}, tables=(table,))
    for row in rows:
        assert {"amplitude", "amplitude_path", "recovery", "recovery_path"} <= set(row.measures)
        pairs = zip(row.measures["amplitude"].values, row.measures["amplitude_path"].values, strict=True)
        assert all(path <= point for point, path in pairs)
    p50 = {key: rows[1].measures[key].quantiles.p50 or 0.0 for key in rows[1].measures}
    assert p50["amplitude"] - p50["amplitude_path"] > 0.05
    assert p50["recovery"] - p50["recovery_path"] > 0.2
    (said,) = lag_text(found)
    q = rows[1].measures["amplitude_path"].quantiles
    assert q.p50 is not None
    assert q.p95 is not None
    assert f"{q.p50:.3g} / {q.p95:.3g} m to the path" in said
    assert said.count("to the desired point") == 4
    report = write_all(found, tmp_path).read_text()
    heads = ["amplitude to the desired point [m]; within 0.3", "amplitude to the path [m]"]
    heads += ["recovery to the desired point [s]; within 3", "recovery to the path [s]"]
    for text in (*heads, said):
        assert text in report


def test_stopped_runs_resume(blind_loop: dict[str, str], tmp_path: Path) -> None:
    experiment = Experiment(
        "short", "close_range", "for the test", ("close",), {"C1": C1}, overrides=blind_loop
    )
    first = measured_trial(experiment.load("C1"), 0)
    shelf = TrialCache(tmp_path, experiment.load("C1"))
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
        list(TrialCache(tmp_path, experiment.load("C1")))
    assert len(joined([both, both]).tables) == 2


def test_a_trial_of_other_code_or_another_scene_is_not_used(
    blind_loop: dict[str, str], tmp_path: Path
) -> None:
    scene = load_scene("close_range", blind_loop)
    trial = measured_trial(scene, 0)
    shelf = TrialCache(tmp_path, scene)
    edited = trial.model_copy(update={"code": "0" * 24})
    with pytest.raises(MsrrError, match="the code was changed while the trials ran"):
        shelf.put(edited)
    assert list(shelf) == []
    other = load_scene("close_range", {**blind_loop, "cameras.onboard.latency_ms": "41"})
    assert TrialCache(tmp_path, other).path != shelf.path
    with pytest.raises(MsrrError, match="another scene"):
        TrialCache(tmp_path, other).put(trial)
    shelf.path.write_text(edited.model_dump_json() + "\n")  # as if two fingerprints began alike
    with pytest.raises(MsrrError, match="another scene or code"):
        list(shelf)


def test_a_run_stops_when_the_code_changes_under_it(
    blind_loop: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment = Experiment("short", "close_range", "", ("close",), {"C1": C1}, overrides=blind_loop)
    # This process believes in other code than its workers load.
    monkeypatch.setattr("msrr_bullet.reproduce.measured_trial.code_fingerprint", lambda scene: "0" * 24)
    with pytest.raises(MsrrError, match="the code was changed"):
        reproduce_bullet([experiment], range(1), tmp_path)
    assert not list(tmp_path.glob("*.jsonl"))


def test_a_target_lost_in_an_earlier_attempt_was_not_kept(blind_loop: dict[str, str]) -> None:
    """The first of two approaches looks away; the second is the one that is measured."""
    scene = load_scene("close_range", blind_loop)
    recorder = SeriesRecorder("a")
    Trial(scene, 0, recorder=recorder).run()
    way = [i for i in recorder.instants if i.action.phase is Phase.DOCK]
    close = CloseSeries.of(recorder.instants, scene, None)
    assert close is not None
    assert close.kept_within(scene.los.outer)
    again = [
        dataclasses.replace(i, action=dataclasses.replace(i.action, attempt=2))
        for i in recorder.instants
        if i.action.stamp_ns >= way[3].action.stamp_ns
    ]
    turned = [dataclasses.replace(i, true={**i.true, "a": i.true["a"] @ SE2(0.0, 0.0, 0.5)}) for i in way[:3]]
    both = CloseSeries.of([*turned, *again], scene, None)
    assert both is not None
    assert len(both.time) == len(close.time) - 3
    assert not both.kept_within(scene.los.outer)
    # A contact in the first approach says nothing about where the second ends.
    early = CloseSeries.of([*turned, *again], scene, seconds(turned[0].action.stamp_ns))
    assert early is not None
    assert len(early.time) == len(both.time)


def test_the_papers_figures_decide(blind_loop: dict[str, str]) -> None:
    trial = measured_trial(load_scene("close_range", blind_loop), 0)
    assert isinstance(trial, MeasuredTrial)
    assert within_paper(trial, ("close",))
    late = trial.model_copy(update={"measures": {**trial.measures, "settling": 4.1}})
    assert not within_paper(late, ("close",))
    assert not within_paper(trial, ("long", "close"))  # it has no long phase
    amplitude = measure("amplitude")
    assert meets(trial, amplitude) is False
    clear = trial.model_copy(update={"measures": {**trial.measures, "tracking": 0.01}})
    assert meets(clear, amplitude) is None  # its path met no obstacle
    assert within_paper(clear, ("long", "close"))
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
