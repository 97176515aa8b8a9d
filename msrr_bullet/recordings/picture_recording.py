"""Recordings that are films, or pictures at a constant rate."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from msrr_bullet.recordings.recording import RecordedFrame, Recording, RecordingError
from msrr_perception.photographs.picture_files import (
    FILMS,
    PictureError,
    check_whole,
    picture_files,
    read_film,
    read_picture,
)
from msrr_scenes.messages import NS_PER_S, Pixels
from msrr_scenes.wording import counted


def open_film(path: Path, latency_ns: int) -> Recording:
    """Return the recording that is a film; its frames say when they were taken.

    The latency is the time from the exposure of a frame to its arrival.

    Raises:
        PictureError: The file is no film.
    """
    next(read_film(path))  # a file that is none is refused before the work begins

    def frames() -> Iterator[RecordedFrame]:
        before_ns, number = -1, -1
        for number, (name, time_s, pixels) in enumerate(read_film(path)):
            # Formats with times in milliseconds may give two frames the same one.
            before_ns = stamp_ns = max(round(time_s * NS_PER_S), before_ns + 1)
            yield RecordedFrame(name, stamp_ns, stamp_ns + latency_ns, partial(_known, pixels), number)
        try:
            check_whole(path, number + 1)
        except PictureError as error:  # what comes before is worth having
            raise RecordingError(str(error)) from None

    return Recording(str(path), frames)


def open_pictures(path: Path, rate_hz: float, latency_ns: int) -> Recording:
    """Return the recording that is a folder of pictures, in the order of their names.

    The path may be that of a single picture, and the latency is as for :func:`open_film`.

    Raises:
        PictureError: The folder cannot be read, or holds no picture.
        RecordingError: It holds films.
    """
    files = picture_files([path])
    films = [file.name for file in files if file.suffix.lower() in FILMS]
    if films:
        raise RecordingError(f"{path}: holds the film {films[0]}; name the film itself, or remove it")

    def frames() -> Iterator[RecordedFrame]:
        for number, file in enumerate(files):
            stamp_ns = round(number * NS_PER_S / rate_hz)
            decode = partial(read_picture, file)
            yield RecordedFrame(str(file), stamp_ns, stamp_ns + latency_ns, decode, number)

    return Recording(f"{path}, {counted(len(files), 'picture')} at {rate_hz:g} Hz", frames, has_times=False)


def _known(pixels: Pixels) -> Pixels:
    return pixels
