"""The summary of a sweep: counts, rates and quantiles of made-up results."""

import pytest

from msrr_bullet.sweep.summarise import summarise
from msrr_bullet.sweep.summary import TrialFailure
from msrr_scenes import load_scene, scene_hash
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene
from tests.bullet.sweep.conftest import made_up


def test_the_numbers(scene: Scene) -> None:
    summary = summarise(scene, "code", [made_up(scene, seed) for seed in range(20)])
    assert summary.trials == 20
    assert summary.outcomes == {"docked": 18, "false_dock": 2}
    assert summary.success.rate == 0.9
    assert summary.success.low < 0.9 < summary.success.high
    (step,) = summary.steps
    assert (step.unit, step.target, step.trials, step.outcomes) == ("a", "b.rear", 20, summary.outcomes)
    assert step.contact_lateral_mm.max == pytest.approx(18.0)
    assert step.contact_yaw_deg.max == pytest.approx(1.8)
    assert step.seated_axial_mm.p50 == pytest.approx(1.0)
    assert step.attempts.max == 2
    assert step.docked_by_attempt == {1: 10, 2: 8}
    assert summary.min_clearance_m == step.min_clearance_m == pytest.approx(0.11)
    assert summary.false_docks == 2
    assert summary.redraws == sum(seed % 3 for seed in range(20))
    assert [(u.seed, u.outcome, u.reason) for u in summary.unsuccessful] == [
        (seed, Outcome.FALSE_DOCK, "made up") for seed in (9, 19)
    ]
    assert not summary.failures
    assert not summary.interrupted


def test_a_failure_of_the_program_counts_as_a_trial(scene: Scene) -> None:
    failures = [
        TrialFailure(scene=scene.name, scene_hash=scene_hash(scene), seed=seed, error="a") for seed in (7, 5)
    ]
    results = [made_up(scene, seed) for seed in range(2)]
    summary = summarise(scene, "code", [*results, *failures], reused=1, interrupted=True)
    assert (summary.trials, summary.success.rate, summary.outcomes) == (4, 0.5, {"docked": 2})
    assert [f.seed for f in summary.failures] == [5, 7]
    assert (summary.reused, summary.interrupted) == (1, True)


def test_a_step_counts_the_trials_that_began_it(scene: Scene) -> None:
    """A plan of two steps: the second begins only in the trials whose first step docked."""
    plan = (scene.plan[0], DockStep(unit="c", to="b.left"))
    twice = scene.model_copy(update={"plan": plan})
    results = []
    for seed in range(20):
        once = made_up(scene, seed)
        (first,) = once.steps
        later = first.model_copy(update={"index": 1, "min_clearance_m": 0.05})
        results.append(once.model_copy(update={"steps": (first, later) if first.docked else (first,)}))
    summary = summarise(twice, "code", results)
    assert [(s.unit, s.target, s.trials) for s in summary.steps] == [("a", "b.rear", 20), ("c", "b.left", 18)]
    assert [s.outcomes for s in summary.steps] == [{"docked": 18, "false_dock": 2}, {"docked": 18}]
    assert [s.min_clearance_m for s in summary.steps] == pytest.approx([0.11, 0.05])
    assert summary.min_clearance_m == 0.05


def test_a_step_that_no_trial_began_has_no_figures(scene: Scene) -> None:
    (step,) = summarise(scene, "code", []).steps
    assert (step.trials, step.outcomes, step.attempts.p50, step.min_clearance_m) == (0, {}, None, None)


def test_a_false_dock_counts_whatever_the_trial_ended_with(scene: Scene) -> None:
    (wrong,) = made_up(scene, 9).steps
    docked = made_up(scene, 0)
    mixed = docked.model_copy(update={"steps": (*docked.steps, wrong)})
    assert summarise(scene, "code", [docked, mixed]).false_docks == 1


def test_docks_at_a_port_once_more() -> None:
    """Only those count that follow a dock of the same unit at the same port, and none that failed."""
    scene = load_scene("dock_again")
    trials = []
    for seed in (4, 9):  # the dock of seed 9 is a false one
        trial = made_up(scene, seed)
        first = trial.steps[0]
        left = first.model_copy(update={"undocks": True, "outcome": Outcome.UNDOCKED})
        elsewhere = first.model_copy(update={"target": "b.left"})
        trials.append(trial.model_copy(update={"steps": (first, left, elsewhere, first)}))
    mission = summarise(scene, "code", trials).mission
    assert mission is not None
    assert (mission.docks.trials, mission.docks_again.trials) == (6, 1)
    assert mission.docks_again.contact_lateral_mm.max == pytest.approx(4.0)
