"""The summary of a sweep: counts, rates and quantiles of made-up results."""

import pytest

from msrr_bullet.sweep.summary import TrialFailure, summarise
from msrr_bullet.sweep.worker_pool import TrialFunction
from msrr_scenes.specs.scene import Scene


def test_the_numbers(scene: Scene, made_up: TrialFunction) -> None:
    summary = summarise(scene, "hash", "code", [made_up(scene, seed) for seed in range(20)])
    assert summary.trials == 20
    assert summary.outcomes == {"docked": 18, "false_dock": 2}
    assert summary.success.rate == 0.9
    assert summary.success.low < 0.9 < summary.success.high
    assert summary.contact_lateral_mm.max == pytest.approx(18.0)
    assert summary.contact_yaw_deg.max == pytest.approx(1.8)
    assert summary.seated_axial_mm.p50 == pytest.approx(1.0)
    assert summary.attempts.max == 2
    assert summary.docked_by_attempt == {1: 10, 2: 8}
    assert summary.min_clearance_m == pytest.approx(0.11)
    assert summary.false_docks == 2
    assert summary.redraws == sum(seed % 3 for seed in range(20))
    assert not summary.failures
    assert not summary.interrupted


def test_a_failure_of_the_program_counts_as_a_trial(scene: Scene, made_up: TrialFunction) -> None:
    failures = [TrialFailure(seed=7, error="b"), TrialFailure(seed=5, error="a")]
    results = [made_up(scene, seed) for seed in range(2)]
    summary = summarise(scene, "hash", "code", results, failures, reused=1, interrupted=True)
    assert (summary.trials, summary.success.rate, summary.outcomes) == (4, 0.5, {"docked": 2})
    assert [f.seed for f in summary.failures] == [5, 7]
    assert (summary.reused, summary.interrupted) == (1, True)
