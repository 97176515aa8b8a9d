"""An image to draw on: the pixels of a frame, enlarged, with smooth lines and words upon them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError

Image = NDArray[np.uint8]
Point = tuple[float, float]

FONT, TEXT_SCALE, SMALL_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.52, 0.44
#: Height of the lines of text above and below a frame [px].
BAR = 26
#: Lengths of the dashes of a broken line and of the gaps between them [px].
DASH, GAP = 9.0, 6.0
#: cv2 takes coordinates in whole multiples of 1/16 px.
_SHIFT = 4
#: Farther outside than this nothing is drawn [px]; cv2's own arithmetic would overflow.
_FAR = 1.0e6
INK, PAPER = 0x1D2733, 0xFFFFFF


def bgr(colour: int) -> tuple[int, int, int]:
    """Return a colour 0xRRGGBB in OpenCV's order."""
    return colour & 255, (colour >> 8) & 255, (colour >> 16) & 255


@dataclass(frozen=True, slots=True)
class Key:
    """An entry of a legend."""

    colour: int
    text: str
    dashed: bool = False


class Canvas:
    """A frame, enlarged by a whole number. Points are in pixels of the frame, counted from their centres."""

    def __init__(self, width: int, height: int, zoom: int, background: int = PAPER) -> None:
        """Begin with one colour."""
        self.zoom = zoom
        self.image: Image = np.full((zoom * height, zoom * width, 3), bgr(background), dtype=np.uint8)

    def paste(self, frame: NDArray[np.uint8], where: NDArray[np.bool_]) -> None:
        """Lay grey pixels, shape (height, width), on top ``where`` it says so; each stays a square."""
        size = (self.image.shape[1], self.image.shape[0])
        grey = cv2.resize(frame, size, interpolation=cv2.INTER_NEAREST)
        mask = cv2.resize(where.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        cv2.copyTo(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), mask, self.image)

    def fill(self, points: Array, colour: int, edge: int | None = None) -> None:
        """Fill a convex outline, shape (N, 2)."""
        if len(points) < 3 or not _near(points):
            return
        p = self._fixed(points)
        cv2.fillConvexPoly(self.image, p, bgr(colour), cv2.LINE_AA, _SHIFT)
        if edge is not None:
            cv2.polylines(self.image, [p], True, bgr(edge), 1, cv2.LINE_AA, _SHIFT)

    def line(
        self,
        points: ArrayLike,
        colour: int,
        width: int = 1,
        *,
        closed: bool = False,
        dashed: bool = False,
        halo: int | None = None,
    ) -> None:
        """Draw a line through ``points``, shape (N, 2); a ``halo`` of another colour lifts it off."""
        p = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        p = p[np.isfinite(p).all(axis=1)]
        if len(p) < 2 or not _near(p):
            return
        p = np.concatenate([p, p[:1]]) if closed else p
        pieces = list(_dashes(p, DASH / self.zoom, GAP / self.zoom)) if dashed else [p]
        fixed = [self._fixed(piece) for piece in pieces]
        if halo is not None:
            cv2.polylines(self.image, fixed, False, bgr(halo), width + 2, cv2.LINE_AA, _SHIFT)
        cv2.polylines(self.image, fixed, False, bgr(colour), width, cv2.LINE_AA, _SHIFT)

    def dot(self, point: ArrayLike, colour: int, radius: float, halo: int | None = None) -> None:
        """Draw a disc of ``radius`` [px of the picture] at a point (2,)."""
        p = np.asarray(point, dtype=np.float64)
        if not np.isfinite(p).all() or not _near(p):
            return
        x, y = (int(a) for a in self._fixed(p[None])[0])
        for r, c in ((radius + 1.5, halo), (radius, colour)):
            if c is not None:
                cv2.circle(self.image, (x, y), round(r * 2**_SHIFT), bgr(c), cv2.FILLED, cv2.LINE_AA, _SHIFT)

    def text(self, point: ArrayLike, words: str, colour: int, halo: int = PAPER) -> None:
        """Write above a point (2,), in the middle; kept inside the picture."""
        p = np.asarray(point, dtype=np.float64)
        if not np.isfinite(p).all() or not _near(p):
            return
        height, width = self.image.shape[:2]
        (w, h), _ = cv2.getTextSize(words, FONT, SMALL_SCALE, 1)
        x, y = self._big(p) + np.array([-0.5 * w, -6.0])
        place = round(min(max(x, 2), width - w - 2)), round(min(max(y, h + 2), height - 4))
        # Not one thicker line of text: fonts with weights make thicker text wider as well.
        around = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
        for (dx, dy), c in [*((step, halo) for step in around), ((0, 0), colour)]:
            at = place[0] + dx, place[1] + dy
            cv2.putText(self.image, words, at, FONT, SMALL_SCALE, bgr(c), 1, cv2.LINE_AA)

    def _big(self, points: Array) -> Array:
        big: Array = (points + 0.5) * self.zoom - 0.5
        return big

    def _fixed(self, points: Array) -> NDArray[np.int32]:
        fixed: NDArray[np.int32] = np.round(self._big(points) * 2**_SHIFT).astype(np.int32)
        return fixed


def _near(points: Array) -> bool:
    return bool(np.abs(points).max() < _FAR)


def _dashes(points: Array, dash: float, gap: float) -> Iterator[Array]:
    """Cut a line, shape (N, 2), into pieces of length ``dash`` with gaps between them."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    for start in np.arange(0.0, along[-1], dash + gap):
        end = min(start + dash, along[-1])
        inside = (along > start) & (along < end)
        at = np.concatenate([[start], along[inside], [end]])
        yield np.column_stack([np.interp(at, along, points[:, i]) for i in (0, 1)])


def framed(image: Image, title: Sequence[str], legend: Sequence[Key]) -> Image:
    """Return a picture with lines of text above it and its legend below."""
    width = image.shape[1]
    head = np.full((BAR * len(title), width, 3), bgr(PAPER), dtype=np.uint8)
    for i, words in enumerate(title):
        cv2.putText(
            head, _fitting(words, width - 16), (8, BAR * i + 18), FONT, TEXT_SCALE, bgr(INK), 1, cv2.LINE_AA
        )
    rows = _rows(legend, width)
    foot = np.full((BAR * len(rows), width, 3), bgr(PAPER), dtype=np.uint8)
    for i, row in enumerate(rows):
        for x, key in row:
            y = BAR * i + BAR // 2
            ends = [(0, 8), (13, 21)] if key.dashed else [(0, 21)]
            for a, b in ends:
                cv2.line(foot, (x + a, y), (x + b, y), bgr(key.colour), 3)
            cv2.putText(foot, key.text, (x + 28, y + 5), FONT, SMALL_SCALE, bgr(INK), 1, cv2.LINE_AA)
    return np.concatenate([head, image, foot])


def _fitting(words: str, width: int) -> str:
    """Return as much of a text as a line of ``width`` [px] holds."""
    if cv2.getTextSize(words, FONT, TEXT_SCALE, 1)[0][0] <= width:
        return words
    while words and cv2.getTextSize(f"{words} ...", FONT, TEXT_SCALE, 1)[0][0] > width:
        words = words[:-1]
    return f"{words.rstrip()} ..."


def _rows(legend: Sequence[Key], width: int) -> list[list[tuple[int, Key]]]:
    """Return the legend's entries with their columns, as many to a row as there is room for."""
    rows: list[list[tuple[int, Key]]] = []
    x = width
    for key in legend:
        need = 28 + cv2.getTextSize(key.text, FONT, SMALL_SCALE, 1)[0][0] + 22
        if x + need > width:
            rows.append([])
            x = 8
        rows[-1].append((x, key))
        x += need
    return rows


def write_png(path: Path, image: Image) -> Path:
    """Write a picture.

    Raises:
        MsrrError: It cannot be written.
    """
    done, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 6])
    if not done:
        raise MsrrError(f"{path}: cannot make a PNG of an image of shape {image.shape}")
    try:
        path.write_bytes(data.tobytes())
    except OSError as error:
        raise MsrrError(f"{path}: cannot be written ({error.strerror})") from None
    return path
