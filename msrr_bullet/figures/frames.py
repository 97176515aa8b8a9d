"""Writes the frames of a run with what the robot made of them drawn on: pictures, a sheet, a film."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from msrr_bullet.figures.artist import Artist
from msrr_bullet.figures.canvas import BAR, PAPER, Image, bgr, framed, write_png
from msrr_bullet.figures.drawing import Picture
from msrr_bullet.log.reader import Log
from msrr_bullet.timeline.camera_views import CameraView, camera_views, exposures, spread
from msrr_perception.pose.overhead_model import OVERHEAD
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import NS_PER_S, Exposure

CameraChoice = Literal["overhead", "onboard", "both"]

#: Frames of each camera that are written unless asked otherwise.
COUNT = 8
SHEET_NAME, FILM_NAME = "sheet.png", "film.webm"
#: Columns of the sheet, and width of each [px].
COLUMNS, TILE_WIDTH = 4, 480
#: Frames per second of the film, which runs at the pace of the trial, and size of each of its pictures [px].
FILM_RATE, FILM_SIZE = 12.5, (800, 600)
#: Height of the film: lines of text above, a picture, a legend in a few rows below [px].
_FILM_HEIGHT = FILM_SIZE[1] + 7 * BAR


class FramesError(MsrrError):
    """A run without such frames, or frames that cannot be written."""


@dataclass(frozen=True, slots=True)
class WrittenFrames:
    """What was written.

    Attributes:
        frames: One picture for each frame, in the order of time.
        sheet: All of them on one page.
        film: The whole run; None unless asked for.
    """

    frames: tuple[Path, ...]
    sheet: Path
    film: Path | None = None


def write_frames(
    log: Log,
    folder: Path,
    camera: CameraChoice = "both",
    *,
    every_s: float | None = None,
    count: int = COUNT,
    film: bool = False,
) -> WrittenFrames:
    """Write annotated frames of a run into a folder. Everything in them comes from the log.

    Args:
        log: The log of the run.
        folder: Is made when it is not there; files of the same names are overwritten.
        camera: Whose frames.
        every_s: One frame of each camera in every ``every_s`` [s]; None for ``count`` frames.
        count: How many frames of each camera, spread over the run.
        film: Also write the whole run as a film: VP8 in WebM.

    Raises:
        FramesError: The run has no such frames, or the folder cannot be written.
    """
    chosen = _chosen(log, camera, every_s, count)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FramesError(f"{folder}: cannot be made a folder ({error.strerror})") from None
    artist = Artist(log)
    paths: list[Path] = []
    tiles: list[Image] = []
    for view in camera_views(log, chosen):
        picture = artist.draw(view)
        name = f"{view.exposure.camera.replace('/', '_')}_{view.exposure.frame:05d}.png"
        paths.append(write_png(folder / name, picture.framed()))
        tiles.append(tile(picture))
    sheet = write_png(folder / SHEET_NAME, _sheet(tiles))
    made = _write_film(log, artist, folder / FILM_NAME, camera) if film else None
    return WrittenFrames(tuple(paths), sheet, made)


def _is_wanted(exposure: Exposure, camera: CameraChoice) -> bool:
    return camera == "both" or (exposure.camera == OVERHEAD) == (camera == "overhead")


def _chosen(log: Log, camera: CameraChoice, every_s: float | None, count: int) -> list[Exposure]:
    if (every_s is not None and every_s <= 0.0) or count < 1:
        raise FramesError("at least one frame, and a time above zero between frames, has to be asked for")
    by_camera: dict[str, list[Exposure]] = {}
    for exposure in exposures(log):
        if _is_wanted(exposure, camera):
            by_camera.setdefault(exposure.camera, []).append(exposure)
    if not by_camera:
        kind = "any camera" if camera == "both" else f"the {camera} camera"
        raise FramesError(
            f"{log.path}: no frame of {kind}; a run has some when its scene has the camera, "
            "perception is images, and the robot looked"
        )
    if every_s is None:
        return [e for found in by_camera.values() for e in spread(found, count)]
    return [e for found in by_camera.values() for e in _paced(found, round(every_s * NS_PER_S))]


def _paced(found: Sequence[Exposure], step_ns: int) -> Iterator[Exposure]:
    """Yield the first exposure of every stretch of ``step_ns``."""
    due = 0
    for exposure in found:
        if exposure.stamp_ns >= due:
            yield exposure
            due = (exposure.stamp_ns // max(step_ns, 1) + 1) * step_ns


def tile(picture: Picture) -> Image:
    """Return a frame in small, with its caption, for a page of several."""
    height, width = picture.image.shape[:2]
    size = (TILE_WIDTH, round(TILE_WIDTH * height / width))
    small = cv2.resize(picture.image, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    return framed(small, [picture.caption], [])


def _sheet(tiles: Sequence[Image]) -> Image:
    gap = 8
    high = max(small.shape[0] for small in tiles)
    columns = min(COLUMNS, len(tiles))
    rows = -(-len(tiles) // columns)
    size = (rows * (high + gap) + gap, columns * (TILE_WIDTH + gap) + gap, 3)
    sheet: Image = np.full(size, bgr(PAPER), dtype=np.uint8)
    for i, small in enumerate(tiles):
        y, x = gap + (i // columns) * (high + gap), gap + (i % columns) * (TILE_WIDTH + gap)
        sheet[y : y + small.shape[0], x : x + TILE_WIDTH] = small
    return sheet


def _write_film(log: Log, artist: Artist, path: Path, camera: CameraChoice) -> Path:
    """Write the run at its own pace, one picture beside the other."""
    scene = log.header.scene
    panels = [OVERHEAD] if scene.cameras.overhead is not None and camera != "onboard" else []
    panels += ["onboard"] if camera != "overhead" else []
    views = camera_views(log, [e for e in exposures(log) if _is_wanted(e, camera)])
    ahead = next(views, None)
    latest: dict[str, CameraView] = {}
    writer: cv2.VideoWriter | None = None
    try:
        for k in range(round(artist.moments.end_ns / NS_PER_S * FILM_RATE) + 1):
            now_ns = round(k * NS_PER_S / FILM_RATE)
            while ahead is not None and ahead.stamp_ns <= now_ns:
                latest[OVERHEAD if ahead.exposure.camera == OVERHEAD else "onboard"] = ahead
                ahead = next(views, None)
            image = np.concatenate([_panel(artist, p, latest.get(p), now_ns) for p in panels], axis=1)
            if writer is None:
                writer = _writer(path, image)
            writer.write(image)
    finally:
        if writer is not None:
            writer.release()
    return path


def _panel(artist: Artist, name: str, latest: CameraView | None, now_ns: int) -> Image:
    """Draw a camera's last frame, or, once the next one has failed to come, its view without pixels."""
    cameras = artist.stagecraft.scene.cameras
    spec = cameras.overhead if name == OVERHEAD and cameras.overhead is not None else cameras.onboard
    if latest is None or now_ns - latest.stamp_ns > 1.5 * NS_PER_S / spec.rate_hz:
        picture = artist.draw_unseen(name, now_ns)
    else:
        picture = artist.draw(latest)
    room_w, room_h = FILM_SIZE
    height, width = picture.image.shape[:2]
    scale = min(room_w / width, room_h / height)
    size = round(scale * width), round(scale * height)
    small = cv2.resize(picture.image, size, interpolation=cv2.INTER_AREA)
    image: Image = np.full((room_h, room_w, 3), bgr(PAPER), dtype=np.uint8)
    image[: size[1], : size[0]] = small
    return _padded(framed(image, picture.title, picture.legend), _FILM_HEIGHT)


def _padded(image: Image, height: int) -> Image:
    """Return a picture of a height, white below or cut off there."""
    padded: Image = np.full((height, image.shape[1], 3), bgr(PAPER), dtype=np.uint8)
    padded[: image.shape[0]] = image[:height]
    return padded


def _writer(path: Path, first: Image) -> cv2.VideoWriter:
    height, width = first.shape[:2]
    code = cv2.VideoWriter.fourcc(*"VP80")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, FILM_RATE, (width, height))
    if not writer.isOpened():
        raise FramesError(f"{path}: OpenCV cannot write a VP8 film here")
    return writer
