"""Two sweeps compared by their tables of trials."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path

import pytest

from msrr_bullet.cli.app import run
from msrr_bullet.sweep.comparison import ComparedFigure, SweepComparison, compare_sweeps
from msrr_bullet.sweep.summarise import summarise
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.trial_table import trials_csv
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.step_result import AssemblyFigures
from msrr_scenes import load_scene, scene_hash
from msrr_scenes.errors import SceneError
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from tests.bullet.sweep.conftest import made_up


def _table(path: Path, outcomes: Iterable[TrialResult | TrialFailure]) -> Path:
    path.write_text(trials_csv(outcomes), encoding="utf-8")
    return path


def _shifted(result: TrialResult, lateral_m: float) -> TrialResult:
    """Return a trial whose pins touched farther off the axis."""
    (step,) = result.steps
    last = step.attempts[-1]
    if last.contact is None:
        return result
    contact = last.contact.model_copy(update={"lateral_m": last.contact.lateral_m + lateral_m})
    last = last.model_copy(update={"contact": contact})
    step = step.model_copy(update={"attempts": (*step.attempts[:-1], last)})
    return result.model_copy(update={"steps": (step,)})


def _figure(comparison: SweepComparison, name: str) -> ComparedFigure:
    (found,) = (figure for figure in comparison.figures if figure.name.startswith(name))
    return found


def test_a_sweep_does_not_differ_from_itself(scene: Scene, tmp_path: Path) -> None:
    table = _table(tmp_path / "a.csv", [made_up(scene, seed) for seed in range(50)])
    found = compare_sweeps(table, table)
    assert (found.trials, found.only_first, found.only_second) == (50, 0, 0)
    assert found.succeeded == (45, 45)
    assert (found.succeeded_alone, found.p) == ((0, 0), 1.0)
    assert len(found.figures) == 6
    for figure in found.figures:
        for q in figure.quantiles:
            assert (q.first, q.difference, q.interval) == (q.second, 0.0, (0.0, 0.0))


def test_trials_are_paired_by_their_seeds(scene: Scene, tmp_path: Path) -> None:
    """Each trial is 2 mm worse, far less than trials differ; order and other seeds make no difference."""
    first = _table(tmp_path / "a.csv", [made_up(scene, seed) for seed in range(60)])
    second = _table(tmp_path / "b.csv", [_shifted(made_up(scene, seed), 2e-3) for seed in range(79, 9, -1)])
    found, back = compare_sweeps(first, second), compare_sweeps(second, first)
    assert (found.trials, found.only_first, found.only_second) == (50, 10, 20)
    lateral, other = (_figure(c, "lateral error") for c in (found, back))
    assert lateral.trials == 45  # a false dock has no contact
    assert _figure(found, "gap between seated faces").trials == 45  # and is not seated
    for q, p in zip(lateral.quantiles, other.quantiles, strict=True):
        assert q.first == p.second
        assert q.interval is not None
        assert p.interval is not None
        assert [q.difference, *q.interval] == pytest.approx([2.0] * 3)
        assert [p.difference, *p.interval] == pytest.approx([-2.0] * 3)
        assert q.is_apart
    assert not any(q.is_apart for q in _figure(found, "yaw error").quantiles)


def _with_second_dock(result: TrialResult) -> TrialResult:
    """Return a trial in which a second unit docks as well, 20 mm farther off the axis."""
    (second,) = _shifted(result, 20e-3).steps
    second = second.model_copy(update={"index": 1, "unit": "c", "target": "b.left"})
    return result.model_copy(update={"steps": (*result.steps, second)})


def test_of_trials_that_ended_early_the_same_steps_count(scene: Scene, tmp_path: Path) -> None:
    """The largest of two steps was compared with that of one: whoever stopped sooner was the more precise."""
    whole = [_with_second_dock(made_up(scene, seed)) for seed in range(0, 100, 2)]
    early = [
        result.model_copy(update={"steps": result.steps[:1], "outcome": Outcome.TIMEOUT}) for result in whole
    ]
    first, second = _table(tmp_path / "a.csv", whole), _table(tmp_path / "b.csv", early)
    for found in (compare_sweeps(first, second), compare_sweeps(second, first)):
        for q in _figure(found, "lateral error").quantiles:
            assert (q.first, q.difference) == (q.second, 0.0)


def _passing(result: TrialResult, recovery_s: float | None) -> TrialResult:
    """Return a trial that passed an obstacle on its way."""
    figures = AssemblyFigures(amplitude_m=0.2, recovery_s=recovery_s)
    (step,) = result.steps
    return result.model_copy(update={"steps": (step.model_copy(update={"assembly": figures}),)})


def test_trials_that_never_recovered_count(scene: Scene, tmp_path: Path) -> None:
    """They were left out, so that who got stuck at an obstacle was the quicker one."""
    quick = [_passing(made_up(scene, seed), 2.0) for seed in range(0, 100, 2)]
    stuck = [_passing(made_up(scene, seed), None if seed % 4 else 2.0) for seed in range(0, 100, 2)]
    found = compare_sweeps(_table(tmp_path / "a.csv", quick), _table(tmp_path / "b.csv", stuck))
    recovery = _figure(found, "recovery")
    assert recovery.trials == len(quick)
    assert (recovery.quantiles[1].first, recovery.quantiles[1].second) == (2.0, math.inf)
    assert summarise(scene, "", stuck).steps[0].recovery_s.p95 == math.inf


KEY = "parametric.sigma_xy_m"


@pytest.fixture
def varied(scene: Scene, tmp_path: Path) -> Path:
    """The table of a variation of three levels, of which the second is 2 mm worse than the first."""
    values = {digest * 32: {KEY: text} for digest, text in zip("abc", ("0.01", "0.020", "0.04"), strict=True)}
    outcomes = [
        _shifted(made_up(scene, seed), 2e-3 * level).model_copy(update={"scene_hash": digest})
        for level, digest in enumerate(values)
        for seed in range(50)
    ]
    table = tmp_path / "noise.csv"
    table.write_text(trials_csv(outcomes, values), encoding="utf-8")
    return table


def test_two_levels_of_a_variation_are_compared(varied: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = compare_sweeps(varied, varied, {KEY: "0.01"}, {KEY: "0.02"})
    assert (found.trials, found.only_first, found.only_second) == (50, 0, 0)
    assert [q.difference for q in _figure(found, "lateral error").quantiles] == pytest.approx([2.0, 2.0])
    assert run(["compare", str(varied), "--first", f"{KEY}=0.01", "--second", f"{KEY}=0.04"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "50 trials with the same seeds" in shown
    assert "sigma_xy_m = 0.04" in shown
    assert "+4.00" in shown
    assert found.chosen == ({KEY: "0.01"}, {KEY: "0.02"})


def test_values_that_were_left_out_are_named(
    scene: Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    levels = [("c1", "careful"), ("c1", "rough"), ("cbf", "careful")]
    values = {d * 32: {"control.docking": c, "as_built": g} for d, (c, g) in zip("abc", levels, strict=True)}
    outcomes = [made_up(scene, 0).model_copy(update={"scene_hash": digest}) for digest in values]
    table = tmp_path / "laws.csv"
    table.write_text(trials_csv(outcomes, values), encoding="utf-8")
    chosen = ["--first", "control.docking=c1", "--second", "control.docking=cbf"]
    assert run(["compare", str(table), *chosen]) == 2
    assert "several sweeps (as_built is careful or rough); give one" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "there is nothing to compare it with; name a second table, or two levels of this one"),
        (
            ["--first", f"{KEY}=0.01"],
            f"these are several sweeps ({KEY} is 0.01 or 0.020); give",
        ),
        (["--first", f"{KEY}=0.02", "--second", f"{KEY}=0.020"], "there is nothing to compare it with"),
        (["--first", f"{KEY}=0.03"], f"no trial with {KEY}=0.03; in the table {KEY} is 0.01 or 0.020 or"),
        (["--first", "parametric.sigma_xy=1"], f"was not set or varied; did you mean '{KEY}'?"),
        (["--first", "0.01"], "--first 0.01: expected KEY=VALUE"),
    ],
)
def test_levels_that_the_table_does_not_have_are_named(
    options: list[str], says: str, varied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["compare", str(varied), *options]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize(("trials", "intervals"), [(1, 0), (8, 0), (9, 1), (39, 1), (40, 2)])
def test_a_few_trials_do_not_tell_two_sweeps_apart(
    scene: Scene, tmp_path: Path, trials: int, intervals: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bootstrap of one trial has a single value, and that of a 95th percentile of ten is the largest."""
    seeds = [seed for seed in range(50) if seed % 10 != 9][:trials]
    first = _table(tmp_path / "a.csv", [made_up(scene, seed) for seed in seeds])
    second = _table(tmp_path / "b.csv", [_shifted(made_up(scene, seed), 2e-3) for seed in seeds])
    lateral = _figure(compare_sweeps(first, second), "lateral error")
    assert lateral.trials == trials
    assert [q.interval is not None for q in lateral.quantiles] == [intervals > 0, intervals > 1]
    assert [q.is_apart for q in lateral.quantiles] == [intervals > 0, intervals > 1]
    assert run(["compare", str(first), str(second)]) == 0
    assert ("too few trials" in " ".join(capsys.readouterr().out.split())) == (intervals < 2)


def test_a_table_that_another_program_has_saved_is_read_the_same(scene: Scene, tmp_path: Path) -> None:
    """Spreadsheets begin a file with a byte order mark; pandas writes 1.0 where a column has gaps."""
    (step,) = made_up(scene, 3).steps
    trial = made_up(scene, 2**62 + 1).model_copy(
        update={"steps": (step.model_copy(update={"undocks": True}),)}
    )
    table = _table(tmp_path / "a.csv", [trial, made_up(scene, 4).model_copy(update={"seed": 2**62})])
    text = table.read_text().replace(",b.rear,1,", ",b.rear,1.0,").replace(",b.rear,0,", ",b.rear,0.0,")
    assert text.count(".0,docked") == 2
    saved = tmp_path / "b.csv"
    saved.write_text(text, encoding="utf-8-sig")
    assert compare_sweeps(saved, saved) == compare_sweeps(table, table)
    assert compare_sweeps(saved, saved).trials == 2


def test_successes_count_where_one_sweep_alone_has_them(scene: Scene, tmp_path: Path) -> None:
    """Two of 18 successes are lost, one as a trial without a result; McNemar's p of 2 to 0 is 2 / 4."""
    trials = [made_up(scene, seed) for seed in range(20)]
    worse: list[TrialResult | TrialFailure] = list(trials)
    worse[4] = trials[4].model_copy(update={"outcome": Outcome.COLLISION})
    worse[5] = TrialFailure(
        scene=scene.name, scene_hash=scene_hash(scene), seed=5, error="out of time", bad_input=True
    )
    found = compare_sweeps(_table(tmp_path / "a.csv", trials), _table(tmp_path / "b.csv", worse))
    assert found.succeeded == (18, 16)
    assert found.without_result == (0, 1)
    assert (found.succeeded_alone, found.p) == ((2, 0), 0.5)
    assert _figure(found, "duration").trials == 16
    assert _figure(found, "attempts").trials == 19


def test_a_trial_of_several_steps_has_the_largest_of_their_errors_and_the_smallest_clearance(
    scene: Scene, tmp_path: Path
) -> None:
    (first,), (second,), (left,) = (made_up(scene, seed).steps for seed in (3, 4, 8))
    steps = (
        first,
        second.model_copy(update={"index": 1}),
        left.model_copy(update={"index": 2, "undocks": True}),
    )
    trial = made_up(scene, 3).model_copy(update={"steps": steps})
    table = _table(tmp_path / "a.csv", [trial])
    found = compare_sweeps(table, table)
    values = {f.name: f.quantiles[0].first for f in found.figures}
    assert values["lateral error at first contact"] == pytest.approx(4.0)
    assert values["smallest clearance"] == pytest.approx(0.26)
    assert values["attempts"] == 2.0


def test_the_command_prints_a_table_and_writes_numbers(
    scene: Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = _table(tmp_path / "a.csv", [made_up(scene, seed) for seed in range(30)])
    second = _table(tmp_path / "b.csv", [_shifted(made_up(scene, seed), 2e-3) for seed in range(30)])
    numbers = tmp_path / "numbers.json"
    assert run(["compare", str(first), str(second), "--json", str(numbers)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "27 of 30" in shown
    assert "+2.00 .. +2.00" in shown
    assert "too few trials" in shown
    assert SweepComparison.model_validate(json.loads(numbers.read_text())) == compare_sweeps(first, second)
    assert run(["compare", str(first), str(second), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["trials"] == 30


def test_scenes_with_different_names_are_told(
    scene: Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Variants of one scene have its name, and a table of an earlier version has none."""
    hard = load_scene("close_range_hard")
    variant = load_scene("close_range", {"control.docking": "linear"})
    failure = TrialFailure(scene=hard.name, scene_hash=scene_hash(hard), seed=0, error="out of time")
    first = _table(tmp_path / "a.csv", [made_up(scene, seed) for seed in range(3)])
    for name, outcomes in (("b.csv", [made_up(hard, 0)]), ("c.csv", [failure])):
        second = _table(tmp_path / name, outcomes)
        assert run(["compare", str(first), str(second)]) == 0
        shown = " ".join(capsys.readouterr().out.split())
        assert "the scenes are close_range and close_range_hard: trials with the same seed share" in shown
    other = _table(tmp_path / "d.csv", [made_up(variant, seed) for seed in range(3)])
    earlier = tmp_path / "e.csv"
    earlier.write_text("".join(line.split(",", 1)[1] for line in first.open()))
    assert earlier.read_text().startswith("seed,")
    for second in (other, earlier):
        assert run(["compare", str(first), str(second)]) == 0
        assert "the scenes are" not in capsys.readouterr().out


def test_what_else_the_sweeps_do_not_share_is_told(
    scene: Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two tables of one scene may be of contact and of a model of it. Other workmanship is what is asked."""
    failure = TrialFailure(
        scene=scene.name, scene_hash=scene_hash(scene), seed=2, error="out of time", bad_input=True
    )
    first = _table(tmp_path / "a.csv", [made_up(scene, 0), made_up(scene, 1), failure])
    for name, values, note in (
        ("b.csv", {"plant": "unicycle"}, "the plants are bullet and unicycle: a difference may be theirs"),
        ("c.csv", {"perception": "parametric"}, "the kinds of perception are images and parametric:"),
        ("d.csv", {"as_built": "rough"}, ""),
    ):
        outcomes = [made_up(scene, seed).model_copy(update=values) for seed in range(3)]
        assert run(["compare", str(first), str(_table(tmp_path / name, outcomes))]) == 0
        shown = " ".join(capsys.readouterr().out.split())
        assert note in shown
        assert (" are " in shown) == bool(note)
        assert "a: 1 trial without a result counts as not succeeded" in shown
        assert shown.count("without a result") == 1


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda text: text.replace("attempts", "tries"), r"b.csv: no column attempts; .* msrr sweep --csv"),
        (lambda text: text.replace("0.3,", "high,"), r"b.csv, line 2: min_clearance_m is 'high'"),
        (
            lambda text: text.replace("0.3,", "inf,"),
            r"b.csv, line 2: min_clearance_m is 'inf', which no trial",
        ),
        (lambda text: text + text.split("\n", 1)[1], r"b.csv, line 4: step 0 of seed 0 a second time"),
        (
            lambda text: (
                text + text.split("\n")[1].replace(",0,a,", ",1,a,").replace("docked", "timeout", 1) + "\n"
            ),
            r"b.csv, line 4: seed 0 ends otherwise than in a row before; give one sweep a file",
        ),
        (lambda text: text.replace("range,", "range,5"), r"no seed in common"),
        (lambda text: text.replace("range,1,", "range,,"), r"b.csv, line 3: no seed"),
        (lambda text: text.replace("range,1,", "range,inf,"), r"line 3: seed is 'inf', which is no whole"),
        (lambda text: text.replace("range,1,", "range,1.5,"), r"line 3: seed is '1.5', which is no whole"),
        (lambda text: text.replace("range,1,", "r,1,"), r"b.csv, line 3: scene close_r after close_range"),
        (lambda text: text.replace("images", "parametric", 1), r"perception images after parametric; give"),
        (lambda text: "", r"b.csv: no column seed"),
        (lambda text: text[:-1], r"b.csv: cut off within its last line"),
        (lambda text: text.rsplit(",", 3)[0] + "\n", r"b.csv, line 3: another number of cells"),
        (lambda text: text.replace("docked", "parked"), r"b.csv, line 2: outcome is 'parked'"),
        (lambda text: text.replace("range,1,", "range,-1,"), r"line 3: seed is -1, and none is negative"),
    ],
)
def test_a_file_that_is_no_table_of_trials_is_refused(
    scene: Scene, tmp_path: Path, edit: object, message: str
) -> None:
    assert callable(edit)
    first = _table(tmp_path / "a.csv", [made_up(scene, seed) for seed in range(2)])
    second = tmp_path / "b.csv"
    second.write_text(edit(first.read_text()))
    with pytest.raises(SceneError, match=message):
        compare_sweeps(first, second)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "a.csv"
    picture.write_bytes(bytes(range(128, 256)))
    for file, text in ((picture, "not a table of trials"), (tmp_path / "none.csv", "No such file")):
        assert run(["compare", str(file), str(file)]) == 2
        assert f"{file}: {text}" in capsys.readouterr().err.replace("\n", " ")
