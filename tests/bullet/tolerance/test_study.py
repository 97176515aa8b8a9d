"""The study finds the law that its trials follow, asks for each trial once, and resumes."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import NormalDist
from typing import Any

import pytest

from msrr_bullet.sweep.trials import one_trial
from msrr_bullet.tolerance.effects import Effect, select_effects
from msrr_bullet.tolerance.error_budget import contributions, predicted
from msrr_bullet.tolerance.model import EffectResult, ToleranceStudy
from msrr_bullet.tolerance.study import run_study, tolerance_study
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import inline


def effect(study: ToleranceStudy, name: str) -> EffectResult:
    return next(e for e in study.effects if e.name == name)


def test_the_threshold_and_the_slopes_of_the_law_are_found(study: ToleranceStudy, law: Any) -> None:
    yaw = effect(study, "onboard.yaw_deg")
    assert yaw.fails is not None
    assert yaw.holds <= law.docks_to_deg < yaw.fails
    assert yaw.sample(yaw.holds).outcomes == {"docked": 20}
    assert set(yaw.sample(yaw.fails).outcomes) == {"false_abort"}
    assert len(yaw.sample(yaw.fails).trials) == 2  # given up as soon as 95 % cannot be reached
    assert yaw.surely_fails == yaw.fails
    assert yaw.lateral is not None
    assert yaw.yaw is not None
    assert yaw.lateral.systematic == pytest.approx(law.mm_per_deg)
    assert yaw.lateral.rms == pytest.approx(law.mm_per_deg)
    assert yaw.yaw.systematic == pytest.approx(0.1)
    assert yaw.sample(yaw.measured).lateral_mm.p50 == pytest.approx(law.mm_per_deg * 0.6, abs=0.1)


def test_a_push_to_a_side_that_differs_counts_fully_and_has_no_direction(
    study: ToleranceStudy, law: Any
) -> None:
    wheel = effect(study, "drive.radius_left_percent")
    assert (wheel.holds, wheel.fails) == (wheel.top, None)
    assert wheel.lateral is not None
    assert wheel.lateral.rms == pytest.approx(law.mm_per_percent)
    assert wheel.lateral.systematic is not None
    assert abs(wheel.lateral.systematic) < 0.7 * law.mm_per_percent
    track = effect(study, "drive.track_percent")
    assert track.lateral is not None
    assert track.lateral.rms == 0.0  # the same seeds, so that nothing but the effect differs


def test_both_signs_are_tried_on_the_common_seeds(study: ToleranceStudy) -> None:
    for found in study.effects:
        measured = found.sample(found.measured)
        assert [trial.seed for trial in measured.trials] == list(study.seeds)
        assert [trial.error for trial in measured.trials] == [found.measured, -found.measured] * 10


def test_the_budget_ranks_what_loses_docks_first(study: ToleranceStudy, law: Any) -> None:
    found = contributions(study)
    assert [c.effect.name for c in found] == [
        "onboard.yaw_deg",
        "drive.radius_left_percent",
        "drive.track_percent",
    ]
    yaw, wheel, track = found
    assert (yaw.used_share, wheel.used_share, track.used_share) == (1.0, 0.0, 0.0)
    assert sum(c.lateral_share for c in found) == pytest.approx(1.0)
    assert yaw.lateral_mm == pytest.approx(0.3 * law.mm_per_deg)
    _, lateral_mm = predicted(found, "workshop")
    assert lateral_mm == pytest.approx(2.0 * math.hypot(yaw.lateral_mm, wheel.lateral_mm))
    # One sigma of rough is 1.2 deg, and 1.37 deg dock: the bracket is 25 % wide, so is what is known of it.
    docked, _ = predicted(found, "rough")
    low, high = (2.0 * NormalDist().cdf(f * law.docks_to_deg / 1.2) - 1.0 for f in (0.8, 1.25))
    assert low < docked < high
    assert predicted(found, "perfect") == (1.0, 0.0)


def test_effects_that_use_up_the_same_limit_add_up(study: ToleranceStudy) -> None:
    """Two equal effects on one limit lose what one of them with the square root of two loses."""
    (yaw, *_) = contributions(study)
    twice, _ = predicted([yaw, yaw], "careful")
    assert twice == pytest.approx(2.0 * NormalDist().cdf(1.0 / (math.sqrt(2.0) * yaw.used)) - 1.0)


def test_an_effect_that_forbids_docking_at_all_is_said_to(
    scene: Scene, effects: tuple[Effect, ...], law: Any
) -> None:
    def never(scene: Scene, seed: int) -> TrialResult:
        docked = not scene.as_built.onboard.yaw_deg.error
        result = law(scene, seed)
        return result if docked else result.model_copy(update={"outcome": Outcome.JAMMED})

    found_study = tolerance_study(
        scene,
        select_effects(effects, ["onboard.yaw_deg"]),
        [],
        seeds=range(6),
        grade_seeds=range(1),
        executor=inline,
        trial=never,
    )
    (found,) = found_study.effects
    assert found.holds == 0.0
    assert found.fails == min(sample.size for sample in found.samples)
    assert found.surely_fails == found.fails


def test_an_interrupted_study_keeps_its_trials(
    scene: Scene, effects: tuple[Effect, ...], law: Any, tmp_path: Path
) -> None:
    progress: list[str] = []

    def stop_in_the_second_round(text: str) -> None:
        progress.append(text)
        if text.startswith("round 2"):
            raise KeyboardInterrupt  # as Ctrl-C does, in the thread that waits

    def run(listener: Callable[[str], None]) -> ToleranceStudy:
        return tolerance_study(
            scene,
            select_effects(effects, ["onboard.yaw_deg"]),
            [],
            seeds=range(4),
            grade_seeds=range(1),
            store=tmp_path / "trials.sqlite",
            executor=inline,
            trial=law,
            on_progress=listener,
        )

    with pytest.raises(KeyboardInterrupt):
        run(stop_in_the_second_round)
    progress.clear()
    run(progress.append)
    assert progress[11].endswith("12 of 12 trials, 12 from the store")
    assert not progress[-1].endswith(" 4 from the store")


@pytest.mark.nightly
def test_a_study_of_real_trials_resumes_from_its_store(
    scene: Scene, effects: tuple[Effect, ...], tmp_path: Path
) -> None:
    """Without contact and pixels: two effects, and the second study runs no trial."""
    ran: list[int] = []

    def counted(scene: Scene, seed: int) -> TrialResult:
        ran.append(seed)
        return one_trial(scene, seed)

    def run() -> ToleranceStudy:
        return tolerance_study(
            scene,
            select_effects(effects, ["drive.radius_left_percent", "tags.yaw_deg"]),
            ["careful"],
            seeds=range(2),
            grade_seeds=range(2),
            store=tmp_path / "trials.sqlite",
            executor=inline,
            trial=counted,
        )

    first = run()
    assert ran
    ran.clear()
    assert run() == first
    assert not ran
    wheel, tags = effect(first, "drive.radius_left_percent"), effect(first, "tags.yaw_deg")
    assert wheel.lateral is not None
    assert tags.lateral is not None
    assert wheel.lateral.systematic is not None
    assert wheel.lateral.systematic < 0.0  # a larger left wheel pushes to the right
    assert tags.lateral.rms > 0.0


@pytest.mark.parametrize(("names", "whole"), [(["onboard.yaw_deg"], False), ((), True)])
def test_a_study_knows_whether_it_tries_all_that_the_grades_have(
    scene: Scene, names: Sequence[str], whole: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[bool] = []

    def stop(*_: Any, all_graded: bool, **__: Any) -> ToleranceStudy:
        told.append(all_graded)
        raise KeyboardInterrupt

    monkeypatch.setattr("msrr_bullet.tolerance.study.tolerance_study", stop)
    with pytest.raises(KeyboardInterrupt):
        run_study(scene, tmp_path, seeds=range(2), grade_seeds=range(1), effects=names)
    assert told == [whole]
