"""Files of pictures and films, read as grey levels.

Pixels are those that the sensor wrote: an orientation in the EXIF data is not applied, because a calibration
belongs to the sensor and not to the way the camera was held.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_perception.photographs.opencv_environment import MOST_PIXELS
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import Pixels

#: Names of files that are looked for in a folder.
PICTURES = (".bmp", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp")
FILMS = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".webm")

#: Share of the frames that a film announces below which it is taken to be cut off: where it tells its
#: length and not the number of frames, that number follows from a nominal rate.
_LEAST_SHARE = 0.9

#: Smallest and largest edge of a picture [px]; smaller ones hold no tag.
_LEAST_EDGE, _GREATEST_EDGE = 16, 32_768

#: Largest size of the file of a picture: colours of 16 bits without compression [bytes].
_GREATEST_BYTES = 8 * MOST_PIXELS


class PictureError(MsrrError):
    """A file that cannot be read as a picture or a film."""


def picture_files(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Return the files that were named, and all pictures and films of the folders that were named.

    Those of a folder are in the order of their names, numbers in which count as such: 2 is before 10.

    Raises:
        PictureError: A folder holds neither, or the name of a file is no text.
        OSError: A folder cannot be read.
    """
    files: list[Path] = []
    for path in paths:
        if not path.is_dir():
            files.append(path)
            continue
        inside = sorted((p for p in path.iterdir() if p.suffix.lower() in PICTURES + FILMS), key=_order)
        if not inside:
            raise PictureError(f"{path}: no picture or film in this folder ({' '.join(PICTURES + FILMS)})")
        files.extend(inside)
    for file in files:
        if _shown(file) != str(file):
            raise PictureError(f"{_shown(file)}: the name of this file is not in UTF-8; give it another one")
    return tuple(dict.fromkeys(files))


def _shown(file: Path) -> str:
    """Return a name that can be printed and written, whatever bytes the file system has for it."""
    return os.fsencode(file).decode("utf-8", "replace")


def _order(file: Path) -> tuple[list[str | int], str]:
    """Return by what files are sorted; every second part of a name is a number."""
    parts = re.split(r"([0-9]+)", file.stem)
    return [int(part) if i % 2 else part for i, part in enumerate(parts)], file.name


class Repeats:
    """Pictures by their pixels, to find those that are there twice: a copy tells nothing new."""

    def __init__(self) -> None:
        """Begin with no picture."""
        self._first: dict[bytes, str] = {}

    def first(self, name: str, pixels: Pixels) -> str | None:
        """Return the name of the earlier picture with these pixels; None keeps this one as the first."""
        digest = hashlib.blake2b(pixels.tobytes(), digest_size=16).digest()
        first = self._first.setdefault(digest, name)
        return None if first is name else first


def read_pictures(file: Path) -> Iterator[tuple[str, Pixels]]:
    """Yield name and mono8 pixels, shape (height, width), of a picture, or of every frame of a film.

    The name is that of the file; frames of a film have their number behind it: ``film.mp4#12``.

    Raises:
        PictureError: The file cannot be read, holds no picture, or one of an impossible size.
    """
    if file.suffix.lower() in FILMS:
        for name, _, pixels in read_film(file):
            yield name, pixels
    else:
        yield str(file), read_picture(file)


def read_picture(file: Path) -> Pixels:
    """Return the pixels of a picture, mono8 of shape (height, width).

    Colours become grey levels, and deeper ones than 8 bits are divided as :func:`mono8` does.

    Raises:
        PictureError: The file cannot be read, holds no picture, or one of an impossible size.
    """
    try:
        if file.exists() and not file.is_file():  # a device may never end
            raise PictureError(f"{file}: not a file")
        if file.stat().st_size > _GREATEST_BYTES:
            raise PictureError(f"{file}: more than {_GREATEST_BYTES // 2**20} MB, too large for a picture")
        content = np.fromfile(file, dtype=np.uint8)
    except OSError as error:
        raise PictureError(f"{file}: cannot be read: {error.strerror or error}") from None
    if not content.size:
        raise PictureError(f"{file}: the file is empty")
    return decoded_picture(content, str(file))


def decoded_picture(content: Pixels, name: str) -> Pixels:
    """Return the pixels of a picture from the bytes of its file, shape (N,), as :func:`read_picture` does.

    Raises:
        PictureError: The bytes hold no picture, or one of an impossible size.
    """
    flags = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        decoded = cv2.imdecode(content, flags) if content.size else None
    except cv2.error as error:
        if "PIXELS" in str(error):
            raise PictureError(f"{name}: more than {MOST_PIXELS} pixels; make it smaller") from None
        decoded = None
    if decoded is None:
        raise PictureError(f"{name}: not a picture that OpenCV can read, or a damaged one")
    return mono8(np.asarray(decoded), name)


def read_film(file: Path) -> Iterator[tuple[str, float, Pixels]]:
    """Yield name, time since the start [s] and mono8 pixels, shape (height, width), of every frame of a film.

    Raises:
        PictureError: The file cannot be read, or holds no film.
    """
    if not file.is_file():
        raise PictureError(f"{file}: no such film")
    film = cv2.VideoCapture(str(file))
    try:
        film.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        number = 0
        while film.isOpened():
            more, frame = film.read()
            if not more:
                break
            name = f"{file}#{number}"
            time_s = 1e-3 * film.get(cv2.CAP_PROP_POS_MSEC)
            yield name, time_s, mono8(np.asarray(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)), name)
            number += 1
    except cv2.error:
        raise PictureError(f"{file}: the film cannot be decoded") from None
    finally:
        film.release()
    if not number:
        raise PictureError(f"{file}: not a film that OpenCV can read, or a damaged one")


def check_whole(film: Path, frames: int) -> None:
    """Refuse a film of which ``frames`` could be read if it says that it has more.

    Raises:
        PictureError: It was cut off, or is damaged behind those frames.
    """
    capture = cv2.VideoCapture(str(film))
    try:
        announced = round(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
    finally:
        capture.release()
    if frames < _LEAST_SHARE * announced:
        raise PictureError(f"{film}: the film ends after {frames} of {announced} frames")


def mono8(grey: NDArray[np.generic], name: str) -> Pixels:
    """Return grey levels as bytes; deeper ones are divided so that all but one pixel in a thousand fit.

    A single hot pixel would make the picture black if all of them had to.

    Raises:
        PictureError: The size is impossible.
    """
    height, width = grey.shape[:2]
    size = f"{width} x {height} px"
    if min(width, height) < _LEAST_EDGE:
        raise PictureError(f"{name}: {size} hold no tag; expected {_LEAST_EDGE} px or more")
    if max(width, height) > _GREATEST_EDGE or width * height > MOST_PIXELS:
        raise PictureError(f"{name}: {size} are too many; make the picture smaller")
    if grey.dtype == np.uint8:
        return np.asarray(grey, dtype=np.uint8)
    levels = np.nan_to_num(grey.astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    count = levels.size // 1000
    brightest = float(np.partition(levels, -1 - count, axis=None)[-1 - count])
    return np.asarray(np.clip(levels * (255.0 / max(brightest, 1e-9)), 0.0, 255.0), dtype=np.uint8)
