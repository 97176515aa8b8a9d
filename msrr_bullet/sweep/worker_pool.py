"""A pool of processes that run trials and survives the death of one of them."""

from __future__ import annotations

import faulthandler
import gc
import logging
import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, NamedTuple, Protocol

from msrr_bullet.sweep.spawned_pool import SpawnedPool, end_with_parent
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.wall_limit import WallLimitError
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.scene import Scene
from msrr_scenes.wording import counted

_log = logging.getLogger(__name__)

#: Runs one trial; importable by name, because it is sent to other processes. A sweep with a limit on the wall
#: clock gives it as ``wall_limit_s``.
TrialFunction = Callable[..., TrialResult]


class TrialTask(NamedTuple):
    """A trial to be run: its scene, the hash of that scene, and its seed."""

    scene: Scene
    scene_hash: str
    seed: int


#: Time that a trial has to end after its limit on the wall clock, at which it was to be stopped [s].
_OVERDUE_S = 15.0

#: What is said where an executor that was given gives a trial up.
_DROPPED = "the executor has dropped a trial; what is done so far is kept in the store"

_DIED = "the process of this trial died: by a crash of compiled code, killed, as for memory, or by os._exit"

#: Called with every finished task, and its result or failure.
Collector = Callable[[TrialTask, TrialResult | TrialFailure], None]


class SupportsSubmit(Protocol):
    """The part of an executor that is used; Dask's ``Client.get_executor()`` and Python's pools have it."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        """Start ``fn(*args)`` in a worker."""
        ...


class WorkerPool:
    """Runs as many trials at the same time as ``slots`` says, in spawned processes or in a given executor."""

    def __init__(
        self,
        slots: Callable[[], int],
        executor: SupportsSubmit | None,
        trial: TrialFunction,
        collector: Collector,
        wall_limit_s: float | None = None,
    ) -> None:
        self._wall_limit_s = wall_limit_s
        self._slots = slots
        self._given = executor
        self._pool: SpawnedPool | None = None
        self._trial = trial
        self._collector = collector
        self._running: dict[Future[Any], TrialTask] = {}
        self._overdue = ""  # why the processes were killed, if they were

    def run(self, tasks: deque[TrialTask]) -> None:
        """Run every task; a task is removed from ``tasks`` when its trial starts."""
        while tasks or self._running:
            slots = self._slots()
            # One more than can run, so that no worker waits; few, so that few are suspects when one dies.
            while tasks and len(self._running) <= slots:
                self._submit(tasks.popleft(), slots)
            suspects = self._collect()
            for task in suspects:
                # The pool does not say whose trial killed a worker; run alone, each trial shows it.
                self._submit(task, 1)
                if self._collect():
                    why, stopped = self._overdue or _DIED, bool(self._overdue)
                    self._collector(task, _failure(task, why, stopped))
            if suspects:
                self._restart()  # the next trial starts a full pool again

    def finish(self) -> None:
        """Wait for the running trials and start no more; another Ctrl-C drops them."""
        for future in list(self._running):
            if future.cancel():
                del self._running[future]
        ahead: list[Future[Any]] = []  # what processes have, which start trials in order, but not begun yet
        if self._pool is not None:
            ahead = [future for future in self._running if not future.done()][self._slots() :]
        begun = self._running.keys() - ahead
        try:
            if begun:
                _log.warning(
                    "interrupted; waits for %s to end, which another Ctrl-C drops",
                    counted(len(begun), "trial"),
                )
            while begun & self._running.keys():
                self._collect()
            self.kill()
        except KeyboardInterrupt:
            self.kill()
        except BaseException:
            self.kill()
            raise

    def kill(self) -> None:
        """Drop the running trials; one that a given executor has begun runs to its end for nothing."""
        for future in self._running:
            future.cancel()
        self._running.clear()
        if self._pool is not None:
            self._pool.kill()

    def close(self) -> bool:
        """End the processes of the pool; return whether Ctrl-C came meanwhile."""
        pool, self._pool = self._pool, None
        return pool is not None and pool.end()

    def _restart(self) -> None:
        """End the processes, so that the next trial starts others."""
        if self.close():
            raise KeyboardInterrupt

    def _submit(self, task: TrialTask, workers: int) -> None:
        executor: SupportsSubmit = self._given if self._given is not None else self._open(workers)
        try:
            future = executor.submit(self._trial, task.scene, task.seed)
        except BrokenProcessPool as error:  # a worker has died since trials were collected last
            if self._pool is None:
                raise MsrrError(_DROPPED) from None
            future = Future()
            future.set_exception(error)
        self._running[future] = task

    def _open(self, workers: int) -> SpawnedPool:
        if self._pool is None:
            self._pool = SpawnedPool(workers, _start_worker)
            try:  # a process that cannot start is no trial that died, and no seed would start one
                self._pool.submit(os.getpid).result()
            except BrokenProcessPool:
                raise MsrrError(
                    "no process for trials can start, for the reason above; a program that sweeps has to be "
                    'a file, and start the sweep below `if __name__ == "__main__":`'
                ) from None
        return self._pool

    def _collect(self) -> list[TrialTask]:
        """Wait until a trial ends and collect all that have; return the tasks that a dead worker left."""
        self._overdue = ""
        most_s = None if self._wall_limit_s is None or self._pool is None else self._wall_limit_s + _OVERDUE_S
        finished, _ = wait(self._running, most_s, return_when=FIRST_COMPLETED)
        if not finished and self._pool is not None:
            # Each trial began when another one ended, or before. A class that goes on after any exception
            # keeps it from being stopped, but its process not from being killed.
            self._overdue = (
                f"the trial was not stopped by the limit of {self._wall_limit_s:g} s on the wall clock, and "
                f"its process was killed {_OVERDUE_S:g} s later; let no class go on after a BaseException"
            )
            self._pool.kill()
            finished, _ = wait(self._running, return_when=FIRST_COMPLETED)
        lost: list[TrialTask] = []
        misuse: MsrrError | None = None
        for future in finished:
            task = self._running[future]
            if future.cancelled():
                raise MsrrError(_DROPPED)
            error = future.exception()
            if error is None:
                self._collector(task, future.result())
            elif isinstance(error, WallLimitError):
                self._collector(task, _failure(task, str(error), stopped=True))
            elif isinstance(error, MsrrError):
                misuse = error
            elif isinstance(error, BrokenProcessPool):
                if self._pool is None:  # whose trial it was, a pool does not say
                    raise MsrrError(_DROPPED)
                lost.append(task)
            else:
                self._collector(task, _failure(task, f"{type(error).__name__}: {error}"))
            del self._running[future]  # not before: after Ctrl-C amid the above it is collected again
        if misuse is not None:
            raise misuse  # other seeds of this scene would hardly run
        if lost:
            lost += self._running.values()
            self._running.clear()
            self._restart()
        return lost


def _failure(task: TrialTask, error: str, stopped: bool = False) -> TrialFailure:
    return TrialFailure(
        scene=task.scene.name, scene_hash=task.scene_hash, seed=task.seed, error=error, stopped=stopped
    )


def _start_worker() -> None:
    """Use one core, and leave the standard output to the command that writes its results there."""
    import cv2

    os.dup2(2, 1)  # what a class of a user's own prints
    faulthandler.enable(2, all_threads=False)  # a crash of compiled code names the line that called it

    gc.set_threshold(50_000)  # as in msrr_bullet.cli.app.main: what is imported is no garbage
    end_with_parent()
    cv2.setNumThreads(1)
