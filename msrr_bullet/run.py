"""Runs a trial and writes a run folder: the log, the result, and what is derived from the log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from msrr_bullet.log.header import LogHeader
from msrr_bullet.log.reader import LOG_NAME, unpacked_log
from msrr_bullet.log.recorder import NullRecorder, Recorder
from msrr_bullet.log.records import BuiltErrors, StartPoses, StepStart
from msrr_bullet.profiler import Profiler
from msrr_bullet.run_folder import (
    PICTURE_NAME,
    REPLAY_NAME,
    RESULT_NAME,
    RunFolderError,
    check_folder,
    delete_run,
    folder_of,
    locked,
    make_folder,
)
from msrr_bullet.seeds import checked_seed
from msrr_bullet.timeline.camera_views import docking_views
from msrr_bullet.timeline.log_snapshots import read_events, read_snapshots
from msrr_bullet.timeline.snapshot import Viewer
from msrr_bullet.trial.check import check_trial
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.telemetry import Progress
from msrr_bullet.trial.trial import Trial
from msrr_bullet.trial.versions import trial_versions
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Exposure, Pixels
from msrr_scenes.specs.scene import Scene
from msrr_scenes.whole_files import write_whole

if TYPE_CHECKING:  # loaded by trials that are logged, for it takes ten megabytes
    from msrr_bullet.log.mcap_recorder import Listener, McapRecorder


def run_trial(
    scene: Scene,
    seed: int = 0,
    *,
    out: str | Path | None = None,
    viewer: Viewer | None = None,
    observer: Callable[[Progress], None] | None = None,
    profiler: Profiler | None = None,
    wall_limit_s: float | None = None,
    listener: Listener | None = None,
) -> TrialResult:
    """Run one trial.

    Trials may run in several threads of a process at the same time, each to the result that it has alone.
    Threads take turns, so that processes, as :func:`msrr_bullet.sweep.sweep.run_sweep` starts them, are done
    sooner.

    Args:
        scene: The scene, from :func:`msrr_scenes.loading.load.load_scene`.
        seed: Seed of all random streams. Scene, seed and
            :func:`~msrr_bullet.trial.versions.trial_versions` determine every bit of the log.
        out: Run folder for ``trial.mcap``, ``result.json``, ``replay.html`` and ``picture.png``; None writes
            nothing. A run that is in the folder is deleted when the first sensor message of the new one is
            recorded; no other file is touched.
        viewer: Gets a snapshot at every control instant; :class:`~msrr_bullet.viewer.live.LiveViewer` is one.
        observer: Called with the progress at every control instant.
        profiler: Measures the time of each stage of the loop.
        wall_limit_s: Time that the trial may take on the wall clock; None sets no limit.
        listener: Gets every message of the log as it is written, if there is a folder;
            :meth:`msrr_bullet.log.foxglove_server.FoxgloveServer.publish` is one.

    Returns:
        The result. A docking that fails is a result, not an error.

    Raises:
        MsrrError: :func:`~msrr_bullet.trial.check.check_trial` refuses the scene, or the folder cannot be
            written, holds a file of such a name that belongs to no run, or is that of a run under way.
        TypeError: The seed is no whole number, the scene is none, or ``out`` is no path.
        ValueError: The seed is negative or above :data:`~msrr_bullet.seeds.MAX_SEED`, ``out`` is empty, or
            ``wall_limit_s`` is no time that a clock can wait for.
        WallLimitError: The trial took longer than ``wall_limit_s``. The log ends there, and has no result.
    """
    seed = checked_seed(seed)  # before the trial, after which the result would refuse it
    if out is not None:
        out = folder_of(out)
        check_folder(out)
    with suppress(ProgramFailedError):  # the trial ends with that outcome
        check_trial(scene)
    with ExitStack() as lock:  # that of the folder, until the last file is written
        recorder: Recorder = NullRecorder()
        if out is not None:
            recorder = _RunRecorder(out, LogHeader.of(scene, seed, trial_versions()), lock, listener)
        with closing(recorder):
            result = Trial(
                scene, seed, recorder=recorder, viewer=viewer, observer=observer, profiler=profiler
            ).run(wall_limit_s)
            # A listener that keeps pace with the wall clock makes closing the log take seconds, and an
            # interrupt in them is to cost no result.
            if out is not None:
                with _telling_outcome(out, result):
                    write_whole(out / RESULT_NAME, result.to_json())
        if out is not None:
            with _telling_outcome(out, result):
                _draw_run(out, result)
            result = result.model_copy(update={"folder": out})
    return result


class _RunRecorder:
    """Records to the log of a run folder, and deletes the run that is there when the trial begins to run.

    A scene that cannot be built does not come that far, and so costs no earlier run.
    """

    def __init__(self, out: Path, header: LogHeader, lock: ExitStack, listener: Listener | None) -> None:
        self._out, self._header, self._lock, self._listener = out, header, lock, listener
        self._head: list[tuple[str, int, object]] = []
        self._log: McapRecorder | None = None

    def write(self, topic: str, stamp_ns: int, message: object) -> None:
        """Record a message."""
        if self._log is None and isinstance(message, (StartPoses, BuiltErrors, StepStart)):
            self._head.append((topic, stamp_ns, message))  # these are written while the trial is being built
        else:
            self._opened().write(topic, stamp_ns, message)

    def window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Record the pixels of a window."""
        self._opened().window(exposure, window, pixels)

    def close(self) -> None:
        """Finish the log, if it was begun."""
        if self._log is not None:
            self._log.close()

    def _opened(self) -> McapRecorder:
        if self._log is None:
            from msrr_bullet.log.mcap_recorder import McapRecorder

            make_folder(self._out)
            self._lock.enter_context(locked(self._out))
            delete_run(self._out)
            self._log = McapRecorder(self._out / LOG_NAME, self._header, listener=self._listener)
            for head in self._head:
                self._log.write(*head)
        return self._log


@contextmanager
def _telling_outcome(out: Path, result: TrialResult) -> Iterator[None]:
    """Tell how the trial ended where a file that follows from it cannot be written."""
    try:
        yield
    except OSError as error:
        kept = f"the trial ended as {result.outcome.value}, and {LOG_NAME} has all of it"
        text = f"{error.filename or out}: cannot be written ({error.strerror}); {kept}"
        raise RunFolderError(text) from None


def _draw_run(out: Path, result: TrialResult) -> None:
    """Write the page and the picture of a run."""
    from msrr_bullet.figures.frames.stills import draw_stills
    from msrr_bullet.figures.plots.summary import write_picture
    from msrr_bullet.viewer.replay_page import write_replay

    with unpacked_log(out) as log:
        snapshots, scene = read_snapshots(log), log.header.scene
        write_replay(out / REPLAY_NAME, scene, snapshots, draw_stills(log, snapshots), read_events(log))
        headline = f"{result.outcome.value}, seed {result.seed}"
        write_picture(out / PICTURE_NAME, scene, snapshots, docking_views(log), headline)
