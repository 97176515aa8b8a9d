"""Files of films: MP4, WebM and GIF, written picture by picture."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from cv2.utils import logging

from msrr_bullet.figures.drawing.canvas import Image
from msrr_scenes.errors import MsrrError
from msrr_scenes.whole_files import part_of, put_in_place, write_whole

#: Pictures in a second of a film.
RATE = 25
#: Codes of the encoders of OpenCV by the ending of the file: MPEG-4 for players and slides, VP8 for browsers.
_CODES = {".mp4": "mp4v", ".webm": "VP80"}
_GIF = ".gif"
#: Endings of films.
ENDINGS = (*_CODES, _GIF)
#: Largest number of pictures of a GIF, which OpenCV encodes all at once, and its largest width [px].
GIF_PICTURES, GIF_WIDTH = 1000, 640


class FilmError(MsrrError):
    """The film cannot be made, or not be written."""


class FilmFile:
    """A film that is being written. Use it in a ``with`` block: an older one stays until it is whole."""

    def __init__(self, path: Path, pictures: int) -> None:
        """Prepare a file.

        Its ending says which kind of film: one of :data:`ENDINGS`. ``pictures`` is the number that it will
        have.

        Raises:
            FilmError: There is no such kind of film, no such folder, or a GIF would have too many pictures.
        """
        self._path, self._kind = path, path.suffix.lower()
        self._part = part_of(path.resolve(), self._kind)
        self._writer: cv2.VideoWriter | None = None
        self._written = 0
        self._gif: list[Image] = []
        if self._kind not in ENDINGS:
            raise FilmError(f"{path}: a film ends in {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}")
        if not path.absolute().parent.is_dir() or path.is_dir():
            raise FilmError(f"{path}: not a file in an existing folder")
        if self._kind == _GIF and pictures > GIF_PICTURES:
            raise FilmError(
                f"{path}: a GIF may have {GIF_PICTURES} pictures, and this one would have {pictures}; "
                f"let it run {pictures / GIF_PICTURES:.1f} times as fast, or write a film that ends in .mp4"
            )

    def write(self, picture: Image) -> None:
        """Append a picture, shape (height, width, 3), BGR; all have the same even height and width.

        Raises:
            FilmError: The file cannot be written.
        """
        if self._kind == _GIF:
            height, width = picture.shape[:2]
            size = min(width, GIF_WIDTH), round(height * min(1.0, GIF_WIDTH / width))
            self._gif.append(cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8))
            return
        if self._writer is None:
            code = cv2.VideoWriter.fourcc(*_CODES[self._kind])
            size = picture.shape[1], picture.shape[0]
            with _silent_standard_error():
                self._writer = cv2.VideoWriter(str(self._part), cv2.CAP_FFMPEG, code, RATE, size)
            if not self._writer.isOpened():
                raise FilmError(f"{self._path}: no film can be begun here; is the disk full?")
        self._writer.write(picture)
        self._written += 1

    def __enter__(self) -> FilmFile:
        # OpenCV warns of every single picture that it cannot write.
        self._level = logging.setLogLevel(logging.LOG_LEVEL_ERROR)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if self._writer is not None:
                self._finish(self._writer, broken_off=kind is not None)
            elif kind is None and self._gif:
                write_whole(self._path, _gif(self._path, self._gif))
        except OSError as failure:
            raise FilmError(f"{self._path}: cannot be written ({failure.strerror})") from None
        finally:
            self._part.unlink(missing_ok=True)
            logging.setLogLevel(self._level)

    def _finish(self, writer: cv2.VideoWriter, *, broken_off: bool) -> None:
        with _silent_standard_error():
            writer.release()
            whole = not broken_off and _pictures_in(self._part) == self._written
        if whole:
            put_in_place(self._part, self._path.resolve())
        elif not broken_off:
            raise FilmError(f"{self._path}: cannot be written to its end; is the disk full?")


@contextmanager
def _silent_standard_error() -> Iterator[None]:
    # OpenCV remarks at every WebM that this kind of file has no list of codes, and of films that are cut off,
    # at no level of its log: it writes from C to the file descriptor.
    sys.stderr.flush()
    kept, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)


def _pictures_in(path: Path) -> int:
    """Return how many pictures a film says that it has.

    OpenCV does not report that a film cannot be written, but that number is what it writes last.
    """
    film = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    return round(film.get(cv2.CAP_PROP_FRAME_COUNT)) if film.isOpened() else 0


def _gif(path: Path, pictures: list[Image]) -> bytes:
    """Return the bytes of a GIF; ``path`` is for messages."""
    animation = cv2.Animation()
    animation.frames, animation.durations = pictures, [1000 // RATE] * len(pictures)
    colours = [cv2.IMWRITE_GIF_QUALITY, cv2.IMWRITE_GIF_COLORTABLE_SIZE_256]
    # It is encoded in memory, because OpenCV does not report that a file cannot be written.
    encoded, data = cv2.imencodeanimation(_GIF, animation, colours)
    if not encoded:
        raise FilmError(f"{path}: OpenCV cannot write a GIF of these pictures")
    return np.asarray(data).tobytes()
