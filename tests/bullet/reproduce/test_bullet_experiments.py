"""The experiments of the real loop: rows of trials, resumed runs, and the paper's values as bounds."""

import math
from pathlib import Path

import pytest

from msrr_bullet.reproduce.bullet_experiments import (
    Experiment,
    meets_paper,
    paper_experiments,
    reproduce_bullet,
    within_paper,
)
from msrr_bullet.reproduce.measured_trial import MeasuredTrial, measured_trial
from msrr_bullet.studies.measures import measure
from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.trial_store import TrialStore
from msrr_scenes.errors import ChangedFileError
from msrr_scenes.loading.load import load_scene, scene_hash
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.spec import Choice

STORE = "trials.sqlite"


#: Name of the function of which the results are.
MEASURED = f"{measured_trial.__module__}.measured_trial"


def keep(path: Path, scene: Scene, *trials: MeasuredTrial) -> None:
    with TrialStore(path, MeasuredTrial) as store:
        for trial in trials:
            store.put(trial, f"{code_fingerprint(scene)} {MEASURED}")


C1 = Choice(name="c1")


def test_the_scenes_of_the_paper_load_under_every_controller() -> None:
    for experiment in paper_experiments({"C1": C1, "CBF": Choice(name="cbf")}):
        for label, choice in experiment.docking.items():
            scene = experiment.load(label)
            assert scene.control.docking == choice
            assert str(scene.as_built) == "perfect"  # as the paper's calibration


@pytest.mark.nightly
def test_stopped_runs_resume(blind_loop: dict[str, str], tmp_path: Path) -> None:
    experiment = Experiment(
        "short", "close_range", "for the test", ("close",), {"C1": C1}, overrides=blind_loop
    )
    first = measured_trial(experiment.load("C1"), 0)
    keep(tmp_path / STORE, experiment.load("C1"), first)
    lines: list[str] = []
    both = reproduce_bullet([experiment], range(2), tmp_path / STORE, on_progress=lines.append)
    assert lines[:2] == ["short, C1: 0 of 2 (0 of all 2)", "short, C1: 1 of 2 (1 of all 2)"]
    assert lines[-1] == "short, C1: 2 of 2 (2 of all 2, about 0 s left)"
    row = both.tables[0].rows[0]
    assert (row.trials, row.outcomes, row.within_paper) == (2, {"docked": 2}, 2)
    assert row.measures["final"].values[0] == pytest.approx(first.measures["final"], abs=1e-6)


def test_a_run_stops_when_the_code_changes_under_it(
    blind_loop: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment = Experiment("short", "close_range", "", ("close",), {"C1": C1}, overrides=blind_loop)
    # The fingerprint of this process differs from that of its workers.
    monkeypatch.setattr("msrr_bullet.sweep.trials.code_fingerprint", lambda scene, **_: "0" * 24)
    with pytest.raises(ChangedFileError, match="was written while the trials ran"):
        reproduce_bullet([experiment], range(1), tmp_path / STORE)
    scene = experiment.load("C1")
    with TrialStore(tmp_path / STORE, MeasuredTrial) as store:
        assert not store.get(scene_hash(scene), f"{'0' * 24} {MEASURED}", range(1))


def test_a_trial_that_never_settled_is_kept_and_counted(blind_loop: dict[str, str], tmp_path: Path) -> None:
    experiment = Experiment(
        "short",
        "close_range",
        "",
        ("close",),
        {"C1": Choice(name="c1")},
        overrides=blind_loop,
    )
    scene = experiment.load("C1")
    trials = [measured_trial(scene, seed) for seed in (0, 1)]
    lost = trials[1].model_copy(update={"measures": {**trials[1].measures, "settling": math.inf}})
    keep(tmp_path / STORE, scene, trials[0], lost)
    row = reproduce_bullet([experiment], range(2), tmp_path / STORE).tables[0].rows[0]
    settling = row.measures["settling"]
    assert (settling.count, settling.never, settling.quantiles.p95) == (2, 1, math.inf)
    assert (row.met["settling"].n, row.met["settling"].of) == (1, 2)
    assert row.within_paper == 1


def test_a_law_that_follows_no_trajectory_has_no_settling_time(
    blind_loop: dict[str, str], tmp_path: Path
) -> None:
    """Also where a trial never came to an approach, which for other laws counts as never settled."""
    graceful = {"GRACEFUL": Choice(name="graceful")}
    experiment = Experiment("short", "close_range", "", ("close",), graceful, overrides=blind_loop)
    scene = experiment.load("GRACEFUL")
    trial = measured_trial(scene, 0)
    lost = trial.model_copy(update={"seed": 1, "measures": {"settling": math.inf}})
    keep(tmp_path / STORE, scene, trial, lost)
    row = reproduce_bullet([experiment], range(2), tmp_path / STORE).tables[0].rows[0]
    assert row.measures["settling"].count == 0
    assert (row.met, row.within_paper) == ({}, None)


def test_a_trial_is_within_the_paper_if_it_meets_every_value(blind_loop: dict[str, str]) -> None:
    trial = measured_trial(load_scene("close_range", blind_loop), 0)
    assert isinstance(trial, MeasuredTrial)
    assert within_paper(trial, ("close",))
    late = trial.model_copy(update={"measures": {**trial.measures, "settling": 4.1}})
    assert not within_paper(late, ("close",))
    assert not within_paper(trial, ("long", "close"))  # it has no long phase
    amplitude = measure("amplitude")
    assert meets_paper(trial, amplitude) is False
    clear = trial.model_copy(update={"measures": {**trial.measures, "tracking": 0.01}})
    assert meets_paper(clear, amplitude) is None  # its path met no obstacle
    assert within_paper(clear, ("long", "close"))
    assert measure("settling").paper_c1 == 4.0


@pytest.mark.parametrize("key", ["tracking", "amplitude", "recovery", "settling", "final"])
def test_the_papers_value_itself_is_within_it(key: str) -> None:
    bound = measure(key).paper_c1
    assert bound is not None
    for value, within in ((bound, True), (1.001 * bound, False), (math.inf, False)):
        trial = MeasuredTrial.model_construct(outcome=Outcome.DOCKED, measures={key: value})
        assert meets_paper(trial, measure(key)) is within
    empty = MeasuredTrial.model_construct(outcome=Outcome.DOCKED, measures={})
    assert meets_paper(empty, measure(key)) is False
    # On a path that was followed without an obstacle there is nothing to swing out for, or to recover from.
    clear = MeasuredTrial.model_construct(outcome=Outcome.DOCKED, measures={"tracking": 0.01})
    expected = {"tracking": True, "amplitude": None, "recovery": None}.get(key, False)
    assert meets_paper(clear, measure(key)) is expected
