"""Many trials of one scene, or of several, and their summaries."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from msrr_bullet.sweep.ended_trials import EndedTrials
from msrr_bullet.sweep.summary import SweepSummary, TrialFailure
from msrr_bullet.sweep.trials import TrialObserver, one_trial, run_trials
from msrr_bullet.sweep.worker_pool import SupportsSubmit, TrialFunction
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.specs.scene import Scene


def run_sweep(
    scene: Scene,
    seeds: Iterable[int],
    jobs: int | Callable[[], int] = 1,
    store: str | Path | None = None,
    *,
    executor: SupportsSubmit | None = None,
    trial: TrialFunction = one_trial,
    observer: TrialObserver | None = None,
    wall_limit_s: float | None = None,
) -> SweepSummary:
    """Run a trial of ``scene`` for each seed; see :func:`msrr_bullet.sweep.trials.run_trials`.

    Args:
        scene: Scene of the trials, already checked.
        seeds: Seeds of the trials; a repeated seed is run once.
        jobs: Number of trials that run at the same time, or what returns it, for a cluster that grows.
        store: SQLite file of results; a trial that it holds for this scene and this code is not run again,
            unless it ended as ``program_failed``.
        executor: Runs the trials instead of a pool of ``jobs`` spawned processes. It is left open. One of
            threads gives the same results, later: threads take turns.
        trial: Runs one trial; importable by name, because it is sent to other processes.
        observer: Called with the result or the failure of each trial as it is done, and with whether it
            comes from the store.
        wall_limit_s: Time that each trial may take on the wall clock; None sets no limit.

    Returns:
        The summary. It names the seed of every trial that took too long, whose program failed, or whose
        process died.

    Raises:
        MsrrError: The scene cannot be run with any seed, or the store cannot be used.
        ChangedFileError: A file of the scene was written while the trials ran. Results from before are kept.
        TypeError: A seed or ``jobs`` is no whole number, ``seeds`` is a single one, or the scene is none.
        ValueError: A seed is negative or above :data:`~msrr_bullet.seeds.MAX_SEED`, or ``jobs`` or
            ``wall_limit_s`` not positive.
    """
    (summary,) = run_sweeps(
        [scene],
        seeds,
        jobs,
        store,
        executor=executor,
        trial=trial,
        observer=observer,
        wall_limit_s=wall_limit_s,
    )
    return summary


def run_sweeps(
    scenes: Sequence[Scene],
    seeds: Iterable[int],
    jobs: int | Callable[[], int] = 1,
    store: str | Path | None = None,
    *,
    executor: SupportsSubmit | None = None,
    trial: TrialFunction = one_trial,
    observer: TrialObserver | None = None,
    wall_limit_s: float | None = None,
) -> list[SweepSummary]:
    """Run a trial of every scene for each seed in one pool; return their summaries; see :func:`run_sweep`."""
    if isinstance(seeds, str) or not isinstance(seeds, Iterable):
        raise TypeError(f"seeds are integers, such as range(20), found {seeds!r}")
    wanted = list(dict.fromkeys(seeds))
    ended = EndedTrials(scenes, wanted)

    def observe(outcome: TrialResult | TrialFailure, stored: bool) -> None:
        ended.add(outcome, stored)
        if observer is not None:
            observer(outcome, stored)

    interrupted = run_trials(
        [(scene, wanted) for scene in scenes],
        jobs,
        store,
        executor=executor,
        trial=trial,
        observer=observe,
        wall_limit_s=wall_limit_s,
    ).interrupted
    return ended.summaries(interrupted=interrupted)
