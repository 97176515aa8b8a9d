"""Trials that run at the same time in several threads of a process."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from msrr_bullet.run import run_trial
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.specs.scene import Scene


def test_trials_with_images_end_in_threads_as_they_do_one_after_the_other(
    shipped: Callable[..., Scene],
) -> None:
    """They shared a detector, which lost tags, or ended the process."""
    scene = shipped("close_range", {"time_limit_s": "2"})

    def run(seed: int) -> TrialResult:
        return run_trial(scene, seed)

    with ThreadPoolExecutor(2) as threads:
        together = list(threads.map(run, range(2)))
    assert together == [run(seed) for seed in range(2)]
