"""A pool of processes that run trials and survives the death of one of them."""

from __future__ import annotations

import faulthandler
import gc
import logging
import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any, NamedTuple, Protocol

from msrr_bullet.sweep.spawned_pool import SpawnedPool, end_with_parent
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.wall_limit import WallLimitError
from msrr_scenes.errors import MsrrError, PlacementError
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
_DROPPED = "the executor has dropped a trial; see whether its scheduler and its workers still run"

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
        self._ended: SimpleQueue[Future[Any]] = SimpleQueue()  # says that a trial has ended
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
        # Processes start trials in order, and have some that they have not begun yet. An executor that is not
        # Python's may say of those that run that it has cancelled them.
        ahead = [future for future in self._running if not future.done()][self._slots() :]
        for future in ahead if self._pool is None else list(self._running):
            if future.cancel():
                del self._running[future]
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
        future.add_done_callback(self._ended.put)

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
        finished = self._wait(most_s)
        if not finished and self._pool is not None:
            # Each trial began when another one ended, or before. A class that goes on after any exception
            # keeps it from being stopped, but its process not from being killed.
            self._overdue = (
                f"the trial was not stopped by the limit of {self._wall_limit_s:g} s on the wall clock, and "
                f"its process was killed {_OVERDUE_S:g} s later; let no class go on after a BaseException"
            )
            self._pool.kill()
            finished = self._wait()
        lost: list[TrialTask] = []
        misuse: MsrrError | None = None
        for future in finished:
            task = self._running[future]
            if future.cancelled():
                raise MsrrError(_DROPPED)
            error = future.exception()
            if error is None:
                self._collector(task, future.result())
            elif isinstance(error, (WallLimitError, PlacementError)):
                self._collector(task, _failure(task, str(error), bad_input=True))
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

    def _wait(self, most_s: float | None = None) -> list[Future[Any]]:
        """Wait until a trial ends, for ``most_s`` at most; return all that have ended, which may be none.

        Not by :func:`concurrent.futures.wait`: where a second signal comes as it is left for a first one, it
        raises ``RuntimeError``, as its lock is not taken back.
        """
        until = None if most_s is None else monotonic() + most_s
        while self._running:
            while not self._ended.empty():  # of what is seen below, and was seen before
                self._ended.get()
            finished = [future for future in self._running if future.done()]
            if finished:
                return finished
            try:
                self._ended.get(timeout=None if until is None else max(until - monotonic(), 0.0))
            except Empty:
                break
        return []


def _failure(task: TrialTask, error: str, bad_input: bool = False) -> TrialFailure:
    return TrialFailure(
        scene=task.scene.name, scene_hash=task.scene_hash, seed=task.seed, error=error, bad_input=bad_input
    )


def _start_worker() -> None:
    """Use one core, and leave the standard output to the command that writes its results there."""
    import cv2

    os.dup2(2, 1)  # what a class of a user's own prints
    faulthandler.enable(2, all_threads=False)  # a crash of compiled code names the line that called it

    gc.set_threshold(50_000)  # as in msrr_bullet.cli.app.main: what is imported is no garbage
    end_with_parent()
    cv2.setNumThreads(1)
