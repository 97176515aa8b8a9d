"""Trials of one or many scenes: spread over processes, kept in a store, resumed after an interruption."""

from __future__ import annotations

import gc
import logging
import sys
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, redirect_stdout, suppress
from dataclasses import dataclass
from functools import partial
from operator import index
from pathlib import Path

from msrr_bullet.seeds import checked_seed
from msrr_bullet.sensors.preparation import prepare_cameras
from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.remote_trial import remote_trial
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.trial_store import StoreError, TrialStore
from msrr_bullet.sweep.worker_pool import SupportsSubmit, Task, TrialFunction, WorkerPool
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene

_log = logging.getLogger(__name__)

#: Called for every finished trial with its result or failure, and whether it came from the store.
TrialObserver = Callable[[TrialResult | TrialFailure, bool], None]


@dataclass(frozen=True)
class FinishedTrials:
    """The trials of :func:`run_trials`.

    Attributes:
        outcomes: Result or failure of every trial that has ended, by hash of its scene and seed.
        reused: Number of trials taken from the store.
        interrupted: Whether the run was stopped before all trials were run.
    """

    outcomes: Mapping[tuple[str, int], TrialResult | TrialFailure]
    reused: int
    interrupted: bool


def one_trial(scene: Scene, seed: int, wall_limit_s: float | None = None) -> TrialResult:
    """Run one trial without a run folder; see :meth:`msrr_bullet.trial.trial.Trial.run`."""
    # A process that only starts trials elsewhere does not load the simulator.
    from msrr_bullet.trial.trial import Trial

    result = Trial(scene, seed).run(wall_limit_s)
    # Cameras, programs and world refer to each other. Left to itself, the collector would come for the memory
    # of several trials at a time, by which a worker would grow by a sixth.
    gc.collect(1)
    return result


def _check(scene: Scene) -> None:
    """Refuse a scene before any trial is started; a class that fails is for the trials to count."""
    from msrr_bullet.trial.check import check_trial

    with suppress(ProgramFailedError), redirect_stdout(sys.stderr):  # what a class of a user's own prints
        check_trial(scene)


def _slots(jobs: int | Callable[[], int]) -> Callable[[], int]:
    """Return what tells the number of trials that run at the same time."""
    if callable(jobs):
        return jobs
    try:
        number = index(jobs)
    except TypeError:
        raise TypeError(f"jobs is an integer, or a function that returns one, found {jobs!r}") from None
    if number < 1:
        raise ValueError(f"expected at least one job, found {number}")
    return lambda: number


def run_trials(
    batches: Iterable[tuple[Scene, Iterable[int]]],
    jobs: int | Callable[[], int] = 1,
    store: str | Path | None = None,
    *,
    executor: SupportsSubmit | None = None,
    trial: TrialFunction = one_trial,
    observer: TrialObserver | None = None,
    wall_limit_s: float | None = None,
) -> FinishedTrials:
    """Run a trial for each seed of each scene, all of them in one pool.

    Ctrl-C stops the run after the trials that are running; a second Ctrl-C drops these as well. In both
    cases every computed result is in the store and among those returned.

    Args:
        batches: Scenes, already checked, with the seeds of their trials; a repeated trial is run once.
        jobs: Number of trials that run at the same time, or what returns it, for a cluster that grows.
        store: SQLite file of results; a trial that it holds for this scene and this code is not run again,
            unless it ended as ``program_failed``.
        executor: Runs the trials instead of a pool of ``jobs`` spawned processes. It is left open. One of
            threads gives the same results, later: threads take turns.
        trial: Runs one trial; importable by name, because it is sent to other processes.
        observer: Called with the result or the failure of each trial as it is done, and with whether it
            comes from the store.
        wall_limit_s: Time that each trial may take on the wall clock; None sets no limit.

    Raises:
        MsrrError: A scene cannot be run with any seed, or the store cannot be used.
        TypeError: A seed or ``jobs`` is no whole number, or a scene is none.
        ValueError: A seed is negative or above :data:`~msrr_bullet.seeds.MAX_SEED`, or ``jobs`` not positive.
    """
    slots = _slots(jobs)
    outcomes: dict[tuple[str, int], TrialResult | TrialFailure] = {}
    codes: dict[str, str] = {}
    asked: set[tuple[str, int]] = set()
    missing: deque[Task] = deque()
    with ExitStack() as stack:
        trial_store = stack.enter_context(TrialStore(Path(store))) if store is not None else None
        for scene, seeds in batches:
            digest, code = scene_hash(scene), code_fingerprint(scene)
            codes[digest] = code
            wanted = [seed for seed in dict.fromkeys(map(checked_seed, seeds)) if (digest, seed) not in asked]
            asked.update((digest, seed) for seed in wanted)
            stored: dict[int, TrialResult] = {}
            if trial_store is not None:
                found = trial_store.get(digest, code, wanted)
                # A class of a user's own may have failed for what is mended since, such as a missing file.
                stored = {s: r for s, r in found.items() if r.outcome is not Outcome.PROGRAM_FAILED}
            for seed, result in stored.items():
                outcomes[digest, seed] = result
                if observer is not None:
                    observer(result, True)
            tasks = [Task(scene, digest, seed) for seed in wanted if seed not in stored]
            if tasks:
                _check(scene)
                if trial_store is not None:
                    trial_store.put_scene(digest, scene.name, scene.model_dump_json())
            if tasks and executor is None:
                prepare_cameras(scene, _log.info)  # once, instead of in every worker at the same time
            missing += tasks
        reused = len(outcomes)

        def collect(task: Task, outcome: TrialResult | TrialFailure) -> None:
            outcomes[task.scene_hash, task.seed] = outcome
            try:
                if trial_store is not None and isinstance(outcome, TrialResult):
                    trial_store.put(outcome, codes[task.scene_hash])
            except StoreError:
                if observer is not None:
                    observer(outcome, False)  # it is a result all the same
                raise
            if observer is not None:
                observer(outcome, False)

        if wall_limit_s is not None:
            trial = partial(trial, wall_limit_s=wall_limit_s)
        if executor is not None:
            trial = partial(remote_trial, trial, codes)
        pool = WorkerPool(slots, executor, trial, collect)
        try:
            pool.run(missing)
            interrupted = False
        except KeyboardInterrupt:
            interrupted = True
            pool.finish()
        except BaseException:
            pool.kill()
            raise
        finally:
            pool.close()
    return FinishedTrials(outcomes, reused, interrupted)
