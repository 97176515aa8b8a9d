"""Many trials of one scene: spread over processes, kept in a store, resumed where they stopped."""

from __future__ import annotations

import logging
import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Protocol

from msrr_bullet.pybullet_client import load_simulator
from msrr_bullet.render import prepare_renderers
from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.summary import SweepSummary, TrialFailure, summarise
from msrr_bullet.sweep.trial_store import TrialStore
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.errors import MsrrError
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.specs.scene import Scene

_log = logging.getLogger(__name__)

#: Runs one trial; importable by name, because it is sent to other processes.
TrialFunction = Callable[[Scene, int], TrialResult]

#: Is told of every trial that is done: its result or failure, and whether it came from the store.
SweepObserver = Callable[[TrialResult | TrialFailure, bool], None]


class Submits(Protocol):
    """What is needed of an executor; Dask's ``Client.get_executor()`` and the pools of Python have it."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Start ``fn(*args)`` somewhere."""
        ...


def one_trial(scene: Scene, seed: int) -> TrialResult:
    """Run one trial without a run folder."""
    from msrr_bullet.trial.trial import (
        Trial,
    )  # the simulator is loaded where trials run, not where they are asked for

    return Trial(scene, seed).run()


def sweep(
    scene: Scene,
    seeds: Iterable[int],
    jobs: int = 1,
    store: Path | None = None,
    *,
    executor: Submits | None = None,
    trial: TrialFunction = one_trial,
    observer: SweepObserver | None = None,
) -> SweepSummary:
    """Run a trial of ``scene`` for each seed.

    Ctrl-C stops it after the trials that are running; a second one drops those. Either way, what was
    computed is in the store and in the summary.

    Args:
        scene: A checked scene.
        seeds: Each is run once.
        jobs: How many trials run at the same time.
        store: SQLite file that keeps results; what it holds for this scene and this code is not run again.
        executor: Runs the trials instead of a pool of ``jobs`` spawned processes. It is left open.
        trial: What one trial is.
        observer: Is told of each trial as it is done.

    Returns:
        The summary. A trial whose program failed, or whose process died, is named in it with its seed.

    Raises:
        MsrrError: The scene cannot be run at all, or the store cannot be used.
        ValueError: ``jobs`` is not positive.
    """
    if jobs < 1:
        raise ValueError(f"expected at least one job, found {jobs}")
    wanted = list(dict.fromkeys(seeds))
    digest, code = scene_hash(scene), code_fingerprint(scene)
    results: dict[int, TrialResult] = {}
    failures: list[TrialFailure] = []
    with ExitStack() as stack:
        shelf = stack.enter_context(TrialStore(store)) if store is not None else None
        if shelf is not None:
            shelf.put_scene(digest, scene.name, scene.model_dump_json())
            results.update(shelf.get(digest, code, wanted))
        reused = len(results)

        def done(seed: int, found: TrialResult | TrialFailure) -> None:
            if isinstance(found, TrialFailure):
                failures.append(found)
            else:
                results[seed] = found
                if shelf is not None:
                    shelf.put(found, code)
            if observer is not None:
                observer(found, False)

        if observer is not None:
            for result in results.values():
                observer(result, True)
        todo = deque(seed for seed in wanted if seed not in results)
        if todo and executor is None:
            prepare_renderers(scene, _log.info)  # once, instead of in every worker at the same time
        crew = WorkerPool(jobs, executor, trial, scene)
        try:
            crew.work(todo, done)
            interrupted = False
        except KeyboardInterrupt:
            interrupted = True
            crew.finish(done)
        except BaseException:
            crew.kill()
            raise
        finally:
            crew.close()
    ordered = [results[seed] for seed in wanted if seed in results]
    return summarise(scene, digest, code, ordered, failures, reused=reused, interrupted=interrupted)


class WorkerPool:
    """Keeps ``jobs`` trials going and survives the death of a worker."""

    def __init__(self, jobs: int, executor: Submits | None, trial: TrialFunction, scene: Scene) -> None:
        self._jobs = jobs
        self._given = executor
        self._pool: ProcessPoolExecutor | None = None
        self._trial = trial
        self._scene = scene
        self._strangers: set[BaseProcess] = set()
        self._running: dict[Future[Any], int] = {}

    def work(self, todo: deque[int], done: Callable[[int, TrialResult | TrialFailure], None]) -> None:
        """Run every seed of ``todo``."""
        while todo or self._running:
            # One more than can run, so that no worker waits; few, so that few are suspects when one dies.
            while todo and len(self._running) <= self._jobs:
                self._submit(todo.popleft(), self._jobs)
            suspects = self._collect(done)
            for seed in suspects:
                # The pool does not say whose trial killed a worker: alone, each one shows.
                self._submit(seed, 1)
                if self._collect(done):
                    done(seed, TrialFailure(seed=seed, error="the process of this trial died"))
            if suspects:
                self.close()  # back to a full pool

    def finish(self, done: Callable[[int, TrialResult | TrialFailure], None]) -> None:
        """Wait for what is running and take no more; another Ctrl-C drops it."""
        for future in list(self._running):
            if future.cancel():
                del self._running[future]
        try:
            while self._running:
                self._collect(done)
        except KeyboardInterrupt:
            self.kill()

    def kill(self) -> None:
        """Drop what is running."""
        self._running.clear()
        if self._pool is not None:
            for child in set(multiprocessing.active_children()) - self._strangers:
                child.terminate()

    def close(self) -> None:
        """Leave no process behind."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    def _submit(self, seed: int, workers: int) -> None:
        executor: Submits = self._given if self._given is not None else self._open(workers)
        self._running[executor.submit(self._trial, self._scene, seed)] = seed

    def _open(self, workers: int) -> ProcessPoolExecutor:
        if self._pool is None:
            # Spawned, never forked: a detector or a simulator does not survive a fork.
            context = multiprocessing.get_context("spawn")
            self._strangers = set(multiprocessing.active_children())
            self._pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker)
        return self._pool

    def _collect(self, done: Callable[[int, TrialResult | TrialFailure], None]) -> list[int]:
        """Wait for some trial and pass on what is finished; return the seeds that a dead worker left."""
        finished, _ = wait(self._running, return_when=FIRST_COMPLETED)
        lost: list[int] = []
        misuse: MsrrError | None = None
        for future in finished:
            seed = self._running.pop(future)
            error = future.exception()
            if error is None:
                done(seed, future.result())
            elif isinstance(error, MsrrError):
                misuse = error
            elif isinstance(error, BrokenProcessPool) and self._pool is not None:
                lost.append(seed)
            else:
                done(seed, TrialFailure(seed=seed, error=f"{type(error).__name__}: {error}"))
        if misuse is not None:
            raise misuse  # no seed would run
        if lost:
            lost += self._running.values()
            self._running.clear()
            self.close()
        return lost


def _start_worker() -> None:
    """Leave Ctrl-C to the parent, which lets running trials finish, and keep to one core."""
    import cv2

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
    load_simulator()
