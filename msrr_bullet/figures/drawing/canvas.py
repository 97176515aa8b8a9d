"""Image to draw on: an enlarged camera frame with smooth lines and text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
from msrr_scenes.whole_files import write_named

Image = NDArray[np.uint8]

FONT, TEXT_SCALE, SMALL_SCALE, TABLE_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.52, 0.44, 0.45
#: Height of the lines of text above and below a frame [px].
BAR = 26
#: Lengths of the dashes of a dashed line and of the gaps between them [px].
DASH, GAP = 9.0, 6.0
#: Length of the head of an arrow [px].
HEAD = 14.0
#: Number of fractional bits of the coordinates that cv2 takes, which are multiples of 1/16 px.
_SHIFT = 4
#: Largest coordinate that is drawn [px]; beyond it the arithmetic of cv2 would overflow.
_FAR = 1.0e6
INK, PAPER = 0x1D2733, 0xFFFFFF
#: Width of a table beside a frame, height of its rows, and space between its columns [px].
TABLE_WIDTH, TABLE_ROW, TABLE_GAP = 480, 22, 12


def bgr(colour: int) -> tuple[int, int, int]:
    """Return a colour 0xRRGGBB in the order of OpenCV."""
    return colour & 255, (colour >> 8) & 255, (colour >> 16) & 255


@dataclass(frozen=True, slots=True)
class Key:
    """Entry of a legend."""

    colour: int
    text: str
    dashed: bool = False


class Canvas:
    """Camera frame, enlarged by a whole number. Points are in pixels of the frame, from pixel centres."""

    def __init__(self, width: int, height: int, zoom: int, background: int = PAPER) -> None:
        """Create the canvas in one colour."""
        self.zoom = zoom
        self.image: Image = np.empty((zoom * height, zoom * width, 3), dtype=np.uint8)
        # Ten times as fast as numpy fills an image with three values.
        cv2.rectangle(self.image, (0, 0), (zoom * width, zoom * height), bgr(background), cv2.FILLED)

    @classmethod
    def of(cls, image: Image) -> Canvas:
        """Return a canvas that draws on an image, shape (height, width, 3), BGR."""
        canvas = cls.__new__(cls)
        canvas.zoom, canvas.image = 1, image
        return canvas

    def paste(self, frame: NDArray[np.uint8], mask: NDArray[np.bool_]) -> None:
        """Copy the masked grey pixels of a frame, shape (height, width), each enlarged to a square."""
        size = (self.image.shape[1], self.image.shape[0])
        grey = cv2.resize(frame, size, interpolation=cv2.INTER_NEAREST)
        enlarged = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        cv2.copyTo(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), enlarged, self.image)

    def fill(self, points: Array, colour: int, edge: int | None = None) -> None:
        """Fill a convex outline, shape (N, 2)."""
        if len(points) < 3 or not _drawable(points):
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
        """Draw a line through points, shape (N, 2), optionally with a halo of another colour."""
        p = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        p = p[np.isfinite(p).all(axis=1)]
        if len(p) < 2 or not _drawable(p):
            return
        p = np.concatenate([p, p[:1]]) if closed else p
        pieces = list(_dashes(p, DASH / self.zoom, GAP / self.zoom)) if dashed else [p]
        fixed = [self._fixed(piece) for piece in pieces]
        if halo is not None:
            cv2.polylines(self.image, fixed, False, bgr(halo), width + 2, cv2.LINE_AA, _SHIFT)
        cv2.polylines(self.image, fixed, False, bgr(colour), width, cv2.LINE_AA, _SHIFT)

    def dot(self, point: ArrayLike, colour: int, radius: float, halo: int | None = None) -> None:
        """Draw a disc at a point (2,); the radius is in pixels of the enlarged image."""
        p = np.asarray(point, dtype=np.float64)
        if not np.isfinite(p).all() or not _drawable(p):
            return
        x, y = (int(a) for a in self._fixed(p[None])[0])
        for r, c in ((radius + 1.5, halo), (radius, colour)):
            if c is not None:
                cv2.circle(self.image, (x, y), round(r * 2**_SHIFT), bgr(c), cv2.FILLED, cv2.LINE_AA, _SHIFT)

    def arrow(self, a: Array, b: Array, colour: int, halo: int | None = None) -> None:
        """Draw an arrow from point a (2,) to b, with a head of :data:`HEAD` pixels of the enlarged image."""
        length = float(np.linalg.norm(b - a))
        if not np.isfinite(length) or length == 0.0:
            return
        along = HEAD / self.zoom * (b - a) / length
        across = 0.4 * np.array([-along[1], along[0]])
        self.line([a, b - along], colour, 2, halo=halo)
        self.line([b - along + across, b, b - along - across], colour, 2, closed=True, halo=halo)
        self.fill(np.array([b - along + across, b, b - along - across]), colour)

    def text(self, point: ArrayLike, text: str, colour: int, scale: float = SMALL_SCALE) -> None:
        """Write centred above a point (2,), moved inside the image if necessary."""
        p = np.asarray(point, dtype=np.float64)
        if not np.isfinite(p).all() or not _drawable(p):
            return
        height, width = self.image.shape[:2]
        (w, h), _ = cv2.getTextSize(text, FONT, scale, 1)
        x, y = self._enlarge(p) + np.array([-0.5 * w, -6.0])
        left, bottom = round(min(max(x, 2), width - w - 2)), round(min(max(y, h + 2), height - 4))
        # The halo is the same text at eight neighbouring places, because thicker text would be wider as well.
        offsets = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
        for (dx, dy), c in [*((offset, PAPER) for offset in offsets), ((0, 0), colour)]:
            origin = left + dx, bottom + dy
            cv2.putText(self.image, text, origin, FONT, scale, bgr(c), 1, cv2.LINE_AA)

    def _enlarge(self, points: Array) -> Array:
        enlarged: Array = (points + 0.5) * self.zoom - 0.5
        return enlarged

    def _fixed(self, points: Array) -> NDArray[np.int32]:
        fixed: NDArray[np.int32] = np.round(self._enlarge(points) * 2**_SHIFT).astype(np.int32)
        return fixed


def _drawable(points: Array) -> bool:
    return bool(np.abs(points).max() < _FAR)


def _dashes(points: Array, dash: float, gap: float) -> Iterator[Array]:
    """Cut a line, shape (N, 2), into pieces of length ``dash`` with gaps between them."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    for start in np.arange(0.0, along[-1], dash + gap):
        end = min(start + dash, along[-1])
        inside = (along > start) & (along < end)
        lengths = np.concatenate([[start], along[inside], [end]])
        yield np.column_stack([np.interp(lengths, along, points[:, i]) for i in (0, 1)])


def titled(image: Image, title: Sequence[str], legend: Sequence[Key]) -> Image:
    """Return an image with lines of text above it and a legend below."""
    width = image.shape[1]
    head = np.full((BAR * len(title), width, 3), bgr(PAPER), dtype=np.uint8)
    for i, line in enumerate(title):
        origin = (8, BAR * i + 18)
        cv2.putText(head, _shortened(line, width - 16), origin, FONT, TEXT_SCALE, bgr(INK), 1, cv2.LINE_AA)
    rows = _legend_rows(legend, width)
    foot = np.full((BAR * len(rows), width, 3), bgr(PAPER), dtype=np.uint8)
    for i, row in enumerate(rows):
        for x, key in row:
            y = BAR * i + BAR // 2
            ends = [(0, 8), (13, 21)] if key.dashed else [(0, 21)]
            for a, b in ends:
                cv2.line(foot, (x + a, y), (x + b, y), bgr(key.colour), 3)
            cv2.putText(foot, key.text, (x + 28, y + 5), FONT, SMALL_SCALE, bgr(INK), 1, cv2.LINE_AA)
    return np.concatenate([head, image, foot])


def table(rows: Sequence[tuple[int, Sequence[str]]], width: int) -> Image:
    """Return a table as an image of a width [px]; each row has a colour and as many cells as the others.

    Columns are as wide as their widest cell; what does not fit into the width is cut off.
    """
    image: Image = np.full((TABLE_ROW * len(rows), width, 3), bgr(PAPER), dtype=np.uint8)
    x = 8
    for y in range(len(rows)):
        top = TABLE_ROW * y
        cv2.rectangle(image, (x, top + 4), (x + 12, top + TABLE_ROW - 5), bgr(rows[y][0]), cv2.FILLED)
    x += 20
    for column in zip(*(cells for _, cells in rows), strict=True):
        for y, cell in enumerate(column):
            origin = (x, TABLE_ROW * y + 15)
            cv2.putText(image, cell, origin, FONT, TABLE_SCALE, bgr(INK), 1, cv2.LINE_AA)
        x += TABLE_GAP + max(cv2.getTextSize(cell, FONT, TABLE_SCALE, 1)[0][0] for cell in column)
    return image


def on_paper(image: Image, width: int, height: int) -> Image:
    """Return an image of a size [px], extended in white or cut off at the right and at the bottom."""
    paper: Image = np.full((height, width, 3), bgr(PAPER), dtype=np.uint8)
    part = image[:height, :width]
    paper[: part.shape[0], : part.shape[1]] = part
    return paper


def _shortened(text: str, width: int) -> str:
    """Return a text, cut off where it does not fit into a line of ``width`` [px]."""
    if cv2.getTextSize(text, FONT, TEXT_SCALE, 1)[0][0] <= width:
        return text
    while text and cv2.getTextSize(f"{text} ...", FONT, TEXT_SCALE, 1)[0][0] > width:
        text = text[:-1]
    return f"{text.rstrip()} ..."


def _legend_rows(legend: Sequence[Key], width: int) -> list[list[tuple[int, Key]]]:
    """Return the entries of the legend with their columns [px], as many in a row as fit."""
    rows: list[list[tuple[int, Key]]] = []
    x = width
    for key in legend:
        needed = 28 + cv2.getTextSize(key.text, FONT, SMALL_SCALE, 1)[0][0] + 22
        if x + needed > width:
            rows.append([])
            x = 8
        rows[-1].append((x, key))
        x += needed
    return rows


def write_png(path: Path, image: Image) -> Path:
    """Write an image as PNG and return the path of the file.

    Raises:
        MsrrError: The image cannot be encoded, or the file cannot be written.
    """
    # It is encoded in memory, because OpenCV does not say why it cannot write a file.
    encoded, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 6])
    if not encoded:
        raise MsrrError(f"{path}: cannot make a PNG of an image of shape {image.shape}")
    write_named(path, data.tobytes())
    return path
