"""Processes that end with the one that started them, as an executor."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from typing import Any

#: Time that processes have to end after their last task [s].
_ENDS_S = 5.0


def end_with_parent() -> None:
    """End this process as soon as the process that spawned it is gone; a pool calls it in each worker.

    A worker waits for work on a pipe of which it holds both ends, and so never learns by itself that its
    parent was killed.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent,), name="msrr-parent", daemon=True).start()


def _follow(parent: BaseProcess) -> None:
    parent.join()  # on a pipe that the parent alone holds open
    os._exit(1)  # the main thread may be in the middle of a trial, whose result nobody waits for


@contextmanager
def starting_deaf() -> Iterator[None]:
    """Let processes and threads that are started meanwhile never learn of Ctrl-C, the parent's to answer.

    They start with the blocked signals of the thread that starts them; what a process did about Ctrl-C
    itself, it would do after its imports, which take a second.
    """
    resource_tracker.ensure_running()  # the first process starts it otherwise, which ends the blocking
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())  # by itself: Ctrl-C may come amid a change
    try:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _NotingContext(SpawnContext):
    """Makes processes that are spawned, and notes them: other children of this program are not the pool's."""

    def __init__(self) -> None:
        super().__init__()
        self.made: list[BaseProcess] = []

    # The base has a class by this name, and executors call it alike.
    def Process(self, *args: Any, **kwargs: Any) -> SpawnProcess:  # type: ignore[override]  # a method for a class
        process = SpawnProcess(*args, **kwargs)
        self.made.append(process)
        return process


class SpawnedPool(ProcessPoolExecutor):
    """Spawned processes, which end with their parent and never learn of Ctrl-C, the parent's to answer.

    An error in a ``with`` block, Ctrl-C included, ends them at once. They are spawned, never forked: a
    detector or a simulator does not survive a fork, and a child of a process with threads may wait for a lock
    for ever.
    """

    def __init__(self, workers: int, initializer: Callable[[], None] = end_with_parent) -> None:
        self._context = _NotingContext()
        super().__init__(workers, self._context, initializer)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Start ``fn(*args, **kwargs)`` in a worker, which may be started for it."""
        with starting_deaf():
            return super().submit(fn, *args, **kwargs)

    def map(
        self,
        fn: Callable[..., Any],
        *iterables: Iterable[Any],
        timeout: float | None = None,
        chunksize: int = 1,
    ) -> Iterator[Any]:
        """Start ``fn`` for all arguments, and yield the results in order; see :class:`Executor`.

        That of Python cancels the rest after an error, over which the thread stumbles that ends a pool whose
        processes are gone. Chunks are of one.
        """
        futures = [self.submit(fn, *each) for each in zip(*iterables, strict=False)]
        return (future.result(timeout) for future in futures)

    def kill(self) -> None:
        """End the processes at once, whatever they do."""
        for process in self._context.made:
            if process.is_alive():
                process.kill()

    def end(self) -> bool:
        """End the processes, and wait until they have ended; return whether Ctrl-C came meanwhile.

        A process waits at its end for the threads that a class of a user's own has started. One that has not
        ended in time, or by then, is killed.
        """
        interrupted = False
        late = threading.Timer(_ENDS_S, self.kill)
        late.daemon = True
        late.start()
        try:
            while True:
                try:
                    self.shutdown(cancel_futures=True)
                    return interrupted
                except KeyboardInterrupt:
                    interrupted = True
                    self.kill()
        except BaseException:
            self.kill()
            raise
        finally:
            late.cancel()

    def __exit__(self, kind: type[BaseException] | None, *error: Any) -> None:
        if kind is not None:
            self.kill()
        if self.end() and kind is None:
            raise KeyboardInterrupt
