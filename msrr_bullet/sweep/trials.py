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
from msrr_bullet.sweep.provenance import check_files, code_fingerprint, own_code
from msrr_bullet.sweep.remote_trial import local_trial, remote_trial
from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.sweep.trial_store import TrialStore
from msrr_bullet.sweep.worker_pool import SupportsSubmit, TrialFunction, TrialTask, WorkerPool
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.wall_limit import check_wall_limit
from msrr_scenes.errors import ChangedFileError, ProgramFailedError
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.outcome import Outcome
from msrr_scenes.own_modules import PACKAGES, digest_of
from msrr_scenes.specs.scene import Scene

_log = logging.getLogger(__name__)

#: Called for every finished trial with its result or failure, and whether it came from the store.
TrialObserver = Callable[[TrialResult | TrialFailure, bool], None]


@dataclass(frozen=True)
class FinishedTrials:
    """The trials of :func:`run_trials` that have ended, by hash of their scene and seed.

    ``interrupted`` is whether the run was stopped before all were run, and ``outdated`` the number of those
    that the store had by other code alone.
    """

    outcomes: Mapping[tuple[str, int], TrialResult | TrialFailure]
    interrupted: bool
    outdated: int


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


def _named(trial: TrialFunction) -> str:
    """Return the name of a function, with the arguments that it is given beside those of a trial.

    That of a user's own has a digest of its file, and of those that it imports, behind it.
    """
    if isinstance(trial, partial):
        return f"{_named(trial.func)} {trial.args} {trial.keywords}"
    name = f"{trial.__module__}.{getattr(trial, '__qualname__', type(trial).__qualname__)}"
    own = trial.__module__.partition(".")[0] not in PACKAGES
    return f"{name} {digest_of(trial.__module__).hex()[:24]}" if own else name


class _WantedTrials:
    """The trials that were asked for: those that have ended, and those that are missing.

    These and those outdated are as in :class:`FinishedTrials`; ``codes`` are the fingerprints of the code of
    every scene, by its hash.
    """

    def __init__(
        self, store: TrialStore | None, observer: TrialObserver | None, trial: TrialFunction
    ) -> None:
        self.outcomes: dict[tuple[str, int], TrialResult | TrialFailure] = {}
        self.codes: dict[str, str] = {}
        self.missing: deque[TrialTask] = deque()
        self.outdated = 0
        self._asked: set[tuple[str, int]] = set()
        self._store, self._observer, self._own = store, observer, own_code()
        self._by = "" if trial is one_trial else f" {_named(trial)}"

    def add(self, scene: Scene, seeds: Iterable[int], runs_here: bool) -> None:
        """Ask for trials of a scene; those in the store have ended.

        ``runs_here`` is whether missing trials are run on this machine, so that what they read is prepared.
        """
        if self._store is not None:
            check_files(scene)
        digest, code = scene_hash(scene), code_fingerprint(scene, own=self._own)
        self.codes[digest] = code
        new = [seed for seed in dict.fromkeys(map(checked_seed, seeds)) if (digest, seed) not in self._asked]
        self._asked.update((digest, seed) for seed in new)
        stored = {} if self._store is None else self._store.get(digest, code + self._by, new)
        # A class of a user's own may have failed for what is mended since, such as a missing file.
        stored = {s: r for s, r in stored.items() if r.outcome is not Outcome.PROGRAM_FAILED}
        for seed, result in stored.items():
            self.outcomes[digest, seed] = result
            self._show(result, True)
        tasks = [TrialTask(scene, digest, seed) for seed in new if seed not in stored]
        if tasks:
            _check(scene)
            if self._store is not None:
                self.outdated += len(
                    self._store.outdated(digest, code + self._by) & {task.seed for task in tasks}
                )
                self._store.put_scene(digest, scene.name, scene.model_dump_json())
            if runs_here:
                prepare_cameras(scene, _log.info)  # once, instead of in every worker at the same time
        self.missing += tasks

    def collect(self, task: TrialTask, outcome: TrialResult | TrialFailure) -> None:
        """Take in what a trial has ended with; it is one of the outcomes even if the store cannot keep it.

        Raises:
            ChangedFileError: The trial was run with other files than those before it.
        """
        if isinstance(outcome, TrialResult) and outcome.scene_hash != task.scene_hash:
            raise ChangedFileError(
                f"{outcome.scene}, seed {outcome.seed}: a URDF, mesh or texture was written while the trials "
                "ran. Results from before are kept; start again, with files that nobody edits"
            )
        self.outcomes[task.scene_hash, task.seed] = outcome
        try:
            if self._store is not None and isinstance(outcome, TrialResult):
                self._store.put(outcome, self.codes[task.scene_hash] + self._by)
        finally:
            self._show(outcome, False)

    def _show(self, outcome: TrialResult | TrialFailure, stored: bool) -> None:
        if self._observer is not None:
            self._observer(outcome, stored)


def run_trials(
    batches: Iterable[tuple[Scene, Iterable[int]]],
    jobs: int | Callable[[], int] = 1,
    store: str | Path | None = None,
    *,
    executor: SupportsSubmit | None = None,
    trial: TrialFunction = one_trial,
    result_type: type[TrialResult] = TrialResult,
    observer: TrialObserver | None = None,
    wall_limit_s: float | None = None,
) -> FinishedTrials:
    """Run a trial for each seed of each scene, all of them in one pool.

    Ctrl-C stops the run after the trials that are running; a second Ctrl-C drops these as well. In both cases
    every computed result is in the store and among those returned. Scenes have been checked, and a repeated
    trial is run once. ``result_type`` is what ``trial`` returns, as which stored results are read; those of
    another function, told apart by its name, are others. All else,
    and the errors, are as for :func:`msrr_bullet.sweep.sweep.run_sweep`.
    """
    slots = _slots(jobs)
    check_wall_limit(wall_limit_s)
    with ExitStack() as stack:
        trial_store = stack.enter_context(TrialStore(Path(store), result_type)) if store is not None else None
        wanted = _WantedTrials(trial_store, observer, trial)
        for scene, seeds in batches:
            wanted.add(scene, seeds, runs_here=executor is None)
        if wall_limit_s is not None:
            trial = partial(trial, wall_limit_s=wall_limit_s)
        trial = partial(local_trial if executor is None else remote_trial, trial, wanted.codes)
        pool, interrupted = WorkerPool(slots, executor, trial, wanted.collect, wall_limit_s), False
        try:
            pool.run(wanted.missing)
        except KeyboardInterrupt:
            interrupted = True
            pool.finish()
        except BaseException:
            pool.kill()
            raise
        finally:
            interrupted = pool.close() or interrupted
    return FinishedTrials(wanted.outcomes, interrupted, wanted.outdated)
