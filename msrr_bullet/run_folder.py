"""A run folder: its files, what may be overwritten in it, and the lock that keeps it for one run."""

from __future__ import annotations

import base64
import fcntl
import html
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from msrr_bullet.log.reader import LOG_NAME, begun_by_msrr
from msrr_scenes.errors import MsrrError

RESULT_NAME = "result.json"
REPLAY_NAME = "replay.html"
PICTURE_NAME = "picture.png"

#: The files of a run, the log last. Files of other names in a run folder are left alone.
RUN_FILES = (RESULT_NAME, REPLAY_NAME, PICTURE_NAME, LOG_NAME)

#: Called with a line of text that says what is done next, or how far a long run is.
ProgressListener = Callable[[str], None]


class RunFolderError(MsrrError):
    """A run folder cannot be written."""


def folder_of(out: object) -> Path:
    """Return the path of a run folder that a program names.

    Raises:
        TypeError: It is no path.
        ValueError: It is empty, which would be the working folder.
    """
    if not isinstance(out, str | os.PathLike):
        raise TypeError(f"out is the path of a run folder; found {out!r:.60}")
    if not os.fspath(out):
        raise ValueError("out is empty; name a run folder, or leave it out")
    return Path(out)


def check_folder(out: Path) -> None:
    """Refuse a folder in which a run would overwrite what no run wrote."""
    present = [name for name in RUN_FILES if os.path.lexists(out / name)]
    foreign = [name for name in present if not (out / name).is_file()]
    if not foreign and present and not (LOG_NAME in present and begun_by_msrr(out / LOG_NAME)):
        foreign = present  # what lies beside a log is of its run; without one, nothing says so
    if foreign:
        raise RunFolderError(
            f"{out}: holds {', '.join(foreign)} without the log of a run beside it;"
            " choose another --out, or move what is there"
        )


def delete_run(out: Path) -> None:
    """Delete what a run wrote, its log last: it tells the folder of a run from others."""
    try:
        for name in RUN_FILES:
            (out / name).unlink(missing_ok=True)
    except OSError as error:
        raise RunFolderError(
            f"{error.filename}: the run of before cannot be deleted ({error.strerror}); choose another --out"
        ) from None


@contextmanager
def locked(out: Path) -> Iterator[None]:
    """Keep a folder for one run; the lock ends with the process at the latest, and leaves no file."""
    folder = os.open(out, os.O_RDONLY)
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            text = "another run is under way in this folder; choose another --out"
            raise RunFolderError(f"{out}: {text}") from None
        yield
    finally:
        os.close(folder)


def make_folder(out: Path) -> None:
    """Make a folder for results, if it is not there, before the work begins.

    Raises:
        RunFolderError: It cannot be made, or no file can be written there.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=out).close()
    except OSError as error:
        raise RunFolderError(
            f"{out}: the folder cannot be made or written ({error.strerror}); choose another --out"
        ) from None


def progress_log(out: Path, on_progress: ProgressListener) -> ProgressListener:
    """Return a listener that also appends every line to ``out/progress.txt``, for runs in the background.

    It raises a :class:`RunFolderError` where the file cannot be written.
    """

    def report(text: str) -> None:
        file = out / "progress.txt"
        try:
            with file.open("a", encoding="utf-8") as lines:
                lines.write(f"{datetime.now():%Y-%m-%d %H:%M:%S} {text}\n")
        except OSError as error:  # that of a full disk names no file
            raise RunFolderError(
                f"{file}: cannot be written ({error.strerror}); make room, or choose another --out"
            ) from None
        on_progress(text)

    return report


def run_html(out: Path) -> str:
    """Return picture and replay page of a run as a notebook shows them; empty where there are none."""
    shown = ""
    if (out / PICTURE_NAME).is_file():
        data = base64.b64encode((out / PICTURE_NAME).read_bytes()).decode()
        shown += f'<img alt="The run" style="max-width:100%" src="data:image/png;base64,{data}">'
    if (out / REPLAY_NAME).is_file():
        page = html.escape((out / REPLAY_NAME).read_text(encoding="utf-8"), quote=True)
        frame = f'<iframe style="width:100%;height:480px;border:0" loading="lazy" srcdoc="{page}"></iframe>'
        shown += f"<details><summary>Replay</summary>{frame}</details>"
    return shown
