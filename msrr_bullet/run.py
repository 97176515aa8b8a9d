"""Runs a trial and writes a run folder: the log, the result, and what is derived from the log."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from msrr_bullet.log.header import LogHeader
from msrr_bullet.log.mcap_recorder import McapRecorder
from msrr_bullet.log.reader import LOG_NAME, read_log
from msrr_bullet.log.recorder import NullRecorder, Recorder
from msrr_bullet.profiler import Profiler
from msrr_bullet.timeline.camera_views import docking_views
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_bullet.timeline.snapshot import Viewer
from msrr_bullet.trial.result import TrialResult, package_versions
from msrr_bullet.trial.telemetry import Progress
from msrr_bullet.trial.trial import Trial
from msrr_scenes.errors import MsrrError
from msrr_scenes.specs.scene import Scene

RESULT_NAME = "result.json"
REPLAY_NAME = "replay.html"
PICTURE_NAME = "picture.png"


class RunFolderError(MsrrError):
    """A run folder cannot be written."""


def run_trial(
    scene: Scene,
    seed: int = 0,
    *,
    out: Path | None = None,
    viewer: Viewer | None = None,
    observer: Callable[[Progress], None] | None = None,
    profiler: Profiler | None = None,
) -> TrialResult:
    """Run one trial.

    Args:
        scene: The scene, from :func:`msrr_scenes.loading.load.load_scene`.
        seed: Seed of all random streams. Scene, seed and installed versions determine every bit of the log.
        out: Run folder for ``trial.mcap``, ``result.json``, ``replay.html`` and ``picture.png``, which are
            overwritten if they exist; None writes nothing.
        viewer: Gets a snapshot at every control instant; :class:`~msrr_bullet.viewer.live.LiveViewer` is one.
        observer: Called with the progress at every control instant.
        profiler: Measures the time of each stage of the loop.

    Returns:
        The result. A docking that fails is a result, not an error.

    Raises:
        MsrrError: The scene names something that does not exist, or the folder cannot be written.
    """
    with ExitStack() as stack:
        recorder: Recorder = NullRecorder()
        if out is not None:
            _make_folder(out)
            header = LogHeader.of(scene, seed, package_versions())
            recorder = stack.enter_context(McapRecorder(out / LOG_NAME, header))
        trial = Trial(scene, seed, recorder=recorder, viewer=viewer, observer=observer, profiler=profiler)
        result = trial.run()
    if out is not None:
        _write_derived_files(out, result)
    return result


def _make_folder(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFolderError(
            f"{out}: the run folder cannot be made ({error.strerror}); choose another --out"
        ) from None


def _write_derived_files(out: Path, result: TrialResult) -> None:
    """Write what follows from the log; the result comes first, in case a later file cannot be written."""
    from msrr_bullet.figures.summary import write_picture
    from msrr_bullet.viewer.replay_page import write_replay

    try:
        (out / RESULT_NAME).write_text(result.to_json())
        log = read_log(out)
        snapshots = read_snapshots(log)
        write_replay(out / REPLAY_NAME, log.header.scene, snapshots)
        headline = f"{result.outcome.value}, seed {result.seed}"
        write_picture(out / PICTURE_NAME, log.header.scene, snapshots, docking_views(log), headline)
    except OSError as error:
        raise RunFolderError(f"{error.filename or out}: cannot be written ({error.strerror})") from None
