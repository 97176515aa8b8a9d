"""Film of a run, from its log: the whole scene in three dimensions, and what the cameras saw."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import cv2
import numpy as np

from msrr_bullet.figures.drawing.canvas import (
    PAPER,
    TABLE_ROW,
    TABLE_WIDTH,
    Image,
    Key,
    bgr,
    on_paper,
    table,
    titled,
)
from msrr_bullet.figures.film.film_file import RATE, FilmError, FilmFile
from msrr_bullet.figures.film.scene_view import SceneView
from msrr_bullet.figures.frames.annotation import AnnotatedFrame
from msrr_bullet.figures.frames.frame_files import FrameAnnotator
from msrr_bullet.log.reader import Log
from msrr_bullet.timeline.camera_views import CameraView, read_camera_views, read_exposures
from msrr_scenes.messages import NS_PER_S, OVERHEAD

#: What a film shows: the scene from beside and above, the overhead camera, the camera of the unit that docks.
Shown = Literal["scene", "overhead", "onboard"]
#: Default width and height of a film [px], the smallest, and the largest.
SIZE, MIN_SIZE, MAX_SIZE = (1280, 720), (320, 240), (3840, 2160)
#: Width [px] from which a part of a film has the whole title and the legend of a frame.
_WIDE = 600


def write_film(
    log: Log,
    path: Path,
    shown: Sequence[Shown] = ("scene",),
    *,
    size: tuple[int, int] = SIZE,
    speed: float = 1.0,
    on_picture: Callable[[int, int], None] | None = None,
) -> Path:
    """Write a film of a whole run, and return its path. Everything in it comes from the log.

    It ends with a second in which the last instant stays.

    Args:
        log: Log of the run.
        path: File to write: MP4, WebM or GIF, by its ending. A file that is there is overwritten.
        shown: What is shown, side by side; of three the first one is larger.
        size: Width and height of the film [px], even numbers.
        speed: Simulated seconds in a second of the film.
        on_picture: Called after every picture with the number of those that are done, and of all.

    Raises:
        FilmError: The size or the speed cannot be, the scene lacks a camera, or the file cannot be written.
        MsrrError: The run ended before the first decision.
    """
    _check(log, shown, size, speed)
    annotator = FrameAnnotator(log)
    end_ns = annotator.trial.end_ns
    count = math.ceil(end_ns * RATE / (speed * NS_PER_S)) + RATE
    with FilmFile(path, count) as film:
        pictures = _Pictures(log, annotator, shown, size)
        for k in range(count):
            now_ns = min(round(k * speed * NS_PER_S / RATE), end_ns)
            if now_ns < end_ns or k == count - RATE:
                picture = pictures.at(now_ns)
            film.write(picture)
            if on_picture is not None:
                on_picture(k + 1, count)
    return path


def _check(log: Log, shown: Sequence[Shown], size: tuple[int, int], speed: float) -> None:
    width, height = size
    low, high = MIN_SIZE, MAX_SIZE
    if not (low[0] <= width <= high[0] and low[1] <= height <= high[1]) or width % 2 or height % 2:
        raise FilmError(
            f"--size {width}x{height}: give two even numbers from {low[0]}x{low[1]} to {high[0]}x{high[1]}"
        )
    if not 0.01 <= speed <= 1000.0:
        raise FilmError(f"--speed {speed:g}: give a number from 0.01 to 1000")
    if not shown or len(shown) != len(set(shown)):
        raise FilmError("a film shows one of scene, overhead and onboard, or several of them, each once")
    if "overhead" in shown and log.header.scene.cameras.overhead is None:
        raise FilmError(f"{log.path}: the scene {log.header.scene.name!r} has no overhead camera to show")


class _Pictures:
    """Pictures of a film, which are asked for in order of time."""

    def __init__(
        self, log: Log, annotator: FrameAnnotator, shown: Sequence[Shown], size: tuple[int, int]
    ) -> None:
        self._annotator, self._size = annotator, size
        self._rooms = dict(zip(shown, _rooms(size, len(shown)), strict=True))
        self._scene: SceneView | None = None
        if "scene" in shown:
            _, _, width, height = self._rooms["scene"]
            legend = SceneView.legend_of(annotator.context) if width >= _WIDE else ()
            room = _room_for_image(width, height, SceneView.LINES, legend)
            self._scene = SceneView(annotator.context, annotator.trial, *room)
        exposures = read_exposures(log) if set(shown) != {"scene"} else ()
        self._views = read_camera_views(log, exposures)
        self._upcoming = next(self._views, None) if exposures else None
        self._latest: dict[str, CameraView] = {}

    def at(self, now_ns: int) -> Image:
        """Return the picture of an instant."""
        while self._upcoming is not None and self._upcoming.stamp_ns <= now_ns:
            self._latest[self._upcoming.exposure.camera] = self._upcoming
            self._upcoming = next(self._views, None)
        picture: Image = np.full((self._size[1], self._size[0], 3), bgr(PAPER), dtype=np.uint8)
        for shown, (x, y, width, height) in self._rooms.items():
            part = _fitted(self._frame(shown, now_ns), width, height)
            top = y + (height - part.shape[0]) // 2
            picture[top : top + part.shape[0], x : x + width] = part
        return picture

    def _frame(self, shown: Shown, now_ns: int) -> AnnotatedFrame:
        if shown == "scene":
            assert self._scene is not None, "the scene is shown"
            return self._scene.draw(now_ns)
        name = OVERHEAD if shown == "overhead" else self._annotator.onboard_at(now_ns)
        return self._annotator.draw_latest(name, self._latest.get(name), now_ns)


def _rooms(size: tuple[int, int], count: int) -> list[tuple[int, int, int, int]]:
    """Return left edge, upper edge, width and height [px] of every part of a film."""
    width, height = size
    if count < 3:
        return [(i * (width // count), 0, width // count, height) for i in range(count)]
    beside = width // 3
    return [
        (0, 0, width - beside, height),
        *((width - beside, i * (height // 2), beside, height // 2) for i in range(2)),
    ]


def _room_for_image(
    width: int, height: int, lines: int, legend: Sequence[Key], below: int = 0
) -> tuple[int, int]:
    """Return width and height [px] that text around an image, and ``below`` pixels, leave to it."""
    text = titled(np.empty((0, width, 3), dtype=np.uint8), [""] * lines, legend)
    return width, max(1, height - len(text) - below)


class _Text(NamedTuple):
    """Text around an image: lines above, legend and height of a table [px] below, width of one beside it."""

    title: Sequence[str]
    legend: Sequence[Key]
    below: int
    beside: int


def _fitted(frame: AnnotatedFrame, width: int, height: int) -> Image:
    """Return a frame with its text, made to fit into a room of a width and a height [px].

    Of the table, the legend and the title there is as much as leaves half of the height to the image.
    """
    choices = [_Text((frame.caption, frame.title[-1]), (), 0, 0)]
    if width >= _WIDE:
        beside = min(TABLE_WIDTH, width // 2)
        around = [(TABLE_ROW * len(frame.table), 0), (0, beside), (0, 0)] if frame.table else [(0, 0)]
        choices = [*(_Text(frame.title, frame.legend, *room) for room in around), *choices]
    sizes = [_image_size(frame.image, text, width, height) for text in choices]
    enough = (k for k, (_, high) in enumerate(sizes) if 2 * high >= height)
    k = next(enough, max(range(len(sizes)), key=lambda i: sizes[i][1]))
    text, shape, image = choices[k], sizes[k], frame.image
    if shape != image.shape[1::-1]:
        image = cv2.resize(image, shape, interpolation=cv2.INTER_AREA).astype(np.uint8)
    paper: Image = np.full((image.shape[0], width - text.beside, 3), bgr(PAPER), dtype=np.uint8)
    left = (width - text.beside - image.shape[1]) // 2
    paper[:, left : left + image.shape[1]] = image
    part = titled(paper, text.title, text.legend)
    if text.beside:
        rows = table(frame.table, text.beside)
        return np.concatenate([part, on_paper(rows, text.beside, len(part))], axis=1)
    return np.concatenate([part, table(frame.table, width)]) if text.below else part


def _image_size(image: Image, text: _Text, width: int, height: int) -> tuple[int, int]:
    """Return width and height [px] of an image in the room that text leaves to it."""
    room = _room_for_image(width - text.beside, height, len(text.title), text.legend, text.below)
    scale = min(room[0] / image.shape[1], room[1] / image.shape[0])
    return max(1, round(scale * image.shape[1])), max(1, round(scale * image.shape[0]))
