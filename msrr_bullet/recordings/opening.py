"""The choice of what a path is: an MCAP file, the log or folder of a trial, a film, or pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from msrr_bullet.log.reader import LOG_NAME, begun_by_msrr
from msrr_bullet.recordings.mcap_recording import NONE, open_mcap
from msrr_bullet.recordings.picture_recording import open_film, open_pictures
from msrr_bullet.recordings.recording import Recording, RecordingError
from msrr_bullet.recordings.trial_recording import open_trial
from msrr_bullet.recordings.wheels import WheelReader
from msrr_perception.photographs.picture_files import FILMS, PICTURES

#: Ending of MCAP files; what the folder of a bag of ROS 2 holds beside them; the ending of its other format.
_MCAP, _BAG, _SQLITE = ".mcap", "metadata.yaml", ".db3"


def open_recording(
    path: Path,
    wheels: Callable[[], WheelReader],
    *,
    topic: str | None,
    odometry: str | None,
    rate_hz: float,
    latency_ns: int,
) -> Recording:
    """Open an MCAP file, bag of ROS 2, run folder of a trial, film, picture, or folder of pictures.

    Topics are None if there is no choice; ``none`` leaves odometry out. ``wheels`` returns a reader of wheel
    angles. Rate and latency are those of pictures that have no times.

    Raises:
        MsrrError: There is nothing, or it cannot be read.
    """
    if not path.exists():
        raise RecordingError(f"{path}: no such file or folder")
    suffixes = [suffix.lower() for suffix in path.suffixes]
    if path.is_dir() and (path / LOG_NAME).is_file():
        path = path / LOG_NAME
    elif _is_bag(path) or _SQLITE in suffixes or (_MCAP in suffixes and suffixes[-1] != _MCAP):
        path = _mcap_of_bag(path)
    if path.suffix.lower() == _MCAP:
        if not path.stat().st_size:
            raise RecordingError(f"{path}: the file is empty")
        if begun_by_msrr(path):
            if odometry not in (None, NONE):
                raise RecordingError(
                    f"{path}: --odometry {odometry}: the log of a trial has the encoders of its own robot; "
                    f"leave it out, or give {NONE}"
                )
            return open_trial(path, topic, odometry=odometry != NONE)
        return open_mcap(path, topic, odometry, wheels)
    if topic is not None or odometry not in (None, NONE):
        raise RecordingError(f"{path}: --topic and --odometry are for MCAP files")
    if path.suffix.lower() in FILMS:
        return open_film(path, latency_ns)
    return open_pictures(path, rate_hz, latency_ns)


def _is_bag(path: Path) -> bool:
    """Return whether a path is a bag of ROS 2; one whose recording was killed has no metadata."""
    if (path / _BAG).is_file():
        return True
    files = list(path.iterdir()) if path.is_dir() else []
    suffixes = {suffix.lower() for file in files for suffix in file.suffixes}
    return not suffixes.isdisjoint((_MCAP, _SQLITE)) and suffixes.isdisjoint((*PICTURES, *FILMS))


def _mcap_of_bag(path: Path) -> Path:
    """Return the file of a bag of ROS 2.

    Raises:
        RecordingError: It has several, or is of another format.
    """
    files = [file for file in path.glob("*") if file.suffix.lower() == _MCAP]
    if len(files) != 1:
        raise RecordingError(
            f"{path}: a bag of ROS 2 is read if it is one MCAP file, not compressed as a whole; this one has "
            f"{len(files)}, and `ros2 bag convert` makes one of it"
        )
    return files[0]
