"""Many trials of one scene: spread over processes, kept in a store, resumed after an interruption."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

from msrr_bullet.pybullet_client import load_simulator
from msrr_bullet.render import prepare_renderers
from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.summary import SweepSummary, TrialFailure, summarise
from msrr_bullet.sweep.trial_store import TrialStore
from msrr_bullet.sweep.worker_pool import SupportsSubmit, TrialFunction, WorkerPool
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.specs.scene import Scene

_log = logging.getLogger(__name__)

#: Called for every finished trial with its result or failure, and whether it came from the store.
SweepObserver = Callable[[TrialResult | TrialFailure, bool], None]


def one_trial(scene: Scene, seed: int, wall_limit_s: float | None = None) -> TrialResult:
    """Run one trial without a run folder; see :meth:`msrr_bullet.trial.trial.Trial.run`."""
    # A process that only starts trials elsewhere does not load the simulator.
    from msrr_bullet.trial.trial import Trial

    return Trial(scene, seed).run(wall_limit_s)


def _check(scene: Scene) -> None:
    """Refuse a scene before any trial is started; a class that fails is for the trials to count."""
    load_simulator()
    from msrr_bullet.trial.check import check_trial

    with suppress(ProgramFailedError):
        check_trial(scene)


def sweep(
    scene: Scene,
    seeds: Iterable[int],
    jobs: int = 1,
    store: Path | None = None,
    *,
    executor: SupportsSubmit | None = None,
    trial: TrialFunction = one_trial,
    observer: SweepObserver | None = None,
    wall_limit_s: float | None = None,
) -> SweepSummary:
    """Run a trial of ``scene`` for each seed.

    Ctrl-C stops the sweep after the trials that are running; a second Ctrl-C drops these as well. In both
    cases every computed result is in the store and in the summary.

    Args:
        scene: Scene of the trials, already checked.
        seeds: Seeds of the trials; a repeated seed is run once.
        jobs: Number of trials that run at the same time.
        store: SQLite file of results; a trial that it holds for this scene and this code is not run again.
        executor: Runs the trials instead of a pool of ``jobs`` spawned processes. It is left open.
        trial: Runs one trial; importable by name, because it is sent to other processes.
        observer: Called with each trial as it is done.
        wall_limit_s: Time that each trial may take on the wall clock; None sets no limit.

    Returns:
        The summary. It names the seed of every trial that took too long, whose program failed, or whose
        process died.

    Raises:
        MsrrError: The scene cannot be run with any seed, or the store cannot be used.
        ValueError: ``jobs`` is not positive.
    """
    if jobs < 1:
        raise ValueError(f"expected at least one job, found {jobs}")
    wanted = list(dict.fromkeys(seeds))
    digest, code = scene_hash(scene), code_fingerprint(scene)
    results: dict[int, TrialResult] = {}
    failures: list[TrialFailure] = []
    with ExitStack() as stack:
        trial_store = stack.enter_context(TrialStore(store)) if store is not None else None
        if trial_store is not None:
            trial_store.put_scene(digest, scene.name, scene.model_dump_json())
            results.update(trial_store.get(digest, code, wanted))
        reused = len(results)

        def collect(seed: int, outcome: TrialResult | TrialFailure) -> None:
            if isinstance(outcome, TrialFailure):
                failures.append(outcome)
            else:
                results[seed] = outcome
                if trial_store is not None:
                    trial_store.put(outcome, code)
            if observer is not None:
                observer(outcome, False)

        if observer is not None:
            for result in results.values():
                observer(result, True)
        missing = deque(seed for seed in wanted if seed not in results)
        if missing:
            _check(scene)
        if missing and executor is None:
            prepare_renderers(scene, _log.info)  # once, instead of in every worker at the same time
        if wall_limit_s is not None:
            trial = partial(trial, wall_limit_s=wall_limit_s)
        pool = WorkerPool(jobs, executor, trial, scene, collect)
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
    ordered = [results[seed] for seed in wanted if seed in results]
    return summarise(scene, digest, code, ordered, failures, reused=reused, interrupted=interrupted)
