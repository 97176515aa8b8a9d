"""Files of annotated frames of a run: single pictures, a sheet of all of them, a film."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from msrr_bullet.figures.annotation import AnnotatedFrame, DrawingContext
from msrr_bullet.figures.canvas import BAR, PAPER, Image, bgr, titled, write_png
from msrr_bullet.figures.onboard_frame import draw_onboard
from msrr_bullet.figures.overhead_frame import draw_overhead
from msrr_bullet.log.reader import Log
from msrr_bullet.timeline.camera_views import (
    CameraView,
    evenly_spaced,
    pinhole_camera,
    read_camera_views,
    read_exposures,
)
from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_perception.pose.overhead_model import OVERHEAD
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import NS_PER_S, Exposure

CameraChoice = Literal["overhead", "onboard", "both"]

#: Default number of frames of each camera.
COUNT = 8
SHEET_NAME, FILM_NAME = "sheet.png", "film.webm"
#: Number of columns of the sheet, and width of each [px].
COLUMNS, TILE_WIDTH = 4, 480
#: Frame rate of the film in simulated time [Hz], and size of the picture of each camera in it [px].
FILM_RATE, FILM_SIZE = 12.5, (800, 600)
#: Height of the film with the title above the pictures and the legend below them [px].
_FILM_HEIGHT = FILM_SIZE[1] + 7 * BAR


class FramesError(MsrrError):
    """The run has no such frames, or they cannot be written."""


class FrameAnnotator:
    """Annotator of the frames of one run.

    Attributes:
        trial: Snapshots of the run at any time.
        context: Scene and models with which frames are drawn.
    """

    def __init__(self, log: Log) -> None:
        """Read the run.

        Raises:
            MsrrError: The run ended before the first decision.
        """
        self.trial = SnapshotInterpolator(read_snapshots(log))
        self.context = DrawingContext(log.header.scene, log.header.seed)

    def draw(self, view: CameraView) -> AnnotatedFrame:
        """Annotate a frame."""
        snapshot = self.trial.at(view.stamp_ns)
        if view.exposure.camera == OVERHEAD:
            return draw_overhead(self.context, view, snapshot, self.trial.until(view.stamp_ns))
        return draw_onboard(self.context, view, snapshot)

    def draw_without_pixels(self, camera: str, stamp_ns: int) -> AnnotatedFrame:
        """Annotate a frame that a camera did not take, drawn from truth alone.

        Args:
            camera: ``overhead``, or any other text for the camera of the unit that docks at that time.
            stamp_ns: Time of the frame.
        """
        step = self.trial.at(stamp_ns).step
        name = f"{step.unit}/onboard" if step and camera != OVERHEAD else camera
        return self.draw(CameraView(Exposure(name, -1, stamp_ns), pinhole_camera(self.context.scene, name)))


@dataclass(frozen=True, slots=True)
class WrittenFrames:
    """Files that were written.

    Attributes:
        frames: One picture for each frame, in order of time.
        sheet: Picture of all frames.
        film: Film of the whole run; None if not requested.
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
        log: Log of the run.
        folder: Folder for the files, created if needed. Files of the same names are overwritten.
        camera: Camera whose frames are written.
        every_s: Time between two frames of a camera [s]; None selects ``count`` frames.
        count: Number of frames of each camera, evenly spaced over the run.
        film: Whether to write the whole run as a film as well: VP8 in WebM.

    Raises:
        FramesError: The run has no such frames, or the folder cannot be written.
    """
    selected = _select(log, camera, every_s, count)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FramesError(f"{folder}: cannot be made a folder ({error.strerror})") from None
    annotator = FrameAnnotator(log)
    paths: list[Path] = []
    tiles: list[Image] = []
    for view in read_camera_views(log, selected):
        frame = annotator.draw(view)
        name = f"{view.exposure.camera.replace('/', '_')}_{view.exposure.frame:05d}.png"
        paths.append(write_png(folder / name, frame.titled()))
        tiles.append(_tile(frame))
    sheet = write_png(folder / SHEET_NAME, _sheet(tiles))
    film_path = _write_film(log, annotator, folder / FILM_NAME, camera) if film else None
    return WrittenFrames(tuple(paths), sheet, film_path)


def _matches(exposure: Exposure, camera: CameraChoice) -> bool:
    return camera == "both" or (exposure.camera == OVERHEAD) == (camera == "overhead")


def _select(log: Log, camera: CameraChoice, every_s: float | None, count: int) -> list[Exposure]:
    if (every_s is not None and every_s <= 0.0) or count < 1:
        raise FramesError("at least one frame, and a time above zero between frames, has to be asked for")
    by_camera: dict[str, list[Exposure]] = {}
    for exposure in read_exposures(log):
        if _matches(exposure, camera):
            by_camera.setdefault(exposure.camera, []).append(exposure)
    if not by_camera:
        kind = "any camera" if camera == "both" else f"the {camera} camera"
        raise FramesError(
            f"{log.path}: no frame of {kind}; a run has some when its scene has the camera, "
            "perception is images, and the robot looked"
        )
    if every_s is None:
        return [e for exposures in by_camera.values() for e in evenly_spaced(exposures, count)]
    return [e for exposures in by_camera.values() for e in _paced(exposures, round(every_s * NS_PER_S))]


def _paced(exposures: Sequence[Exposure], step_ns: int) -> Iterator[Exposure]:
    """Yield the first exposure in every interval of length ``step_ns``."""
    due = 0
    for exposure in exposures:
        if exposure.stamp_ns >= due:
            yield exposure
            due = (exposure.stamp_ns // max(step_ns, 1) + 1) * step_ns


def _tile(frame: AnnotatedFrame) -> Image:
    """Return a small image of a frame with its caption."""
    height, width = frame.image.shape[:2]
    size = (TILE_WIDTH, round(TILE_WIDTH * height / width))
    small = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    return titled(small, [frame.caption], [])


def _sheet(tiles: Sequence[Image]) -> Image:
    gap = 8
    tile_height = max(small.shape[0] for small in tiles)
    columns = min(COLUMNS, len(tiles))
    rows = -(-len(tiles) // columns)
    size = (rows * (tile_height + gap) + gap, columns * (TILE_WIDTH + gap) + gap, 3)
    sheet: Image = np.full(size, bgr(PAPER), dtype=np.uint8)
    for i, small in enumerate(tiles):
        y, x = gap + (i // columns) * (tile_height + gap), gap + (i % columns) * (TILE_WIDTH + gap)
        sheet[y : y + small.shape[0], x : x + TILE_WIDTH] = small
    return sheet


def _write_film(log: Log, annotator: FrameAnnotator, path: Path, camera: CameraChoice) -> Path:
    """Write the run in simulated time, with the cameras side by side."""
    scene = log.header.scene
    panels = [OVERHEAD] if scene.cameras.overhead is not None and camera != "onboard" else []
    panels += ["onboard"] if camera != "overhead" else []
    views = read_camera_views(log, [e for e in read_exposures(log) if _matches(e, camera)])
    upcoming = next(views, None)
    latest: dict[str, CameraView] = {}
    writer: cv2.VideoWriter | None = None
    try:
        for k in range(round(annotator.trial.end_ns / NS_PER_S * FILM_RATE) + 1):
            now_ns = round(k * NS_PER_S / FILM_RATE)
            while upcoming is not None and upcoming.stamp_ns <= now_ns:
                latest[OVERHEAD if upcoming.exposure.camera == OVERHEAD else "onboard"] = upcoming
                upcoming = next(views, None)
            image = np.concatenate(
                [_panel(annotator, panel, latest.get(panel), now_ns) for panel in panels], axis=1
            )
            if writer is None:
                writer = _writer(path, image)
            writer.write(image)
    finally:
        if writer is not None:
            writer.release()
    return path


def _panel(annotator: FrameAnnotator, name: str, latest: CameraView | None, now_ns: int) -> Image:
    """Draw the last frame of a camera, or its view without pixels when the next frame is overdue."""
    cameras = annotator.context.scene.cameras
    spec = cameras.overhead if name == OVERHEAD and cameras.overhead is not None else cameras.onboard
    if latest is None or now_ns - latest.stamp_ns > 1.5 * NS_PER_S / spec.rate_hz:
        frame = annotator.draw_without_pixels(name, now_ns)
    else:
        frame = annotator.draw(latest)
    height, width = frame.image.shape[:2]
    scale = min(FILM_SIZE[0] / width, FILM_SIZE[1] / height)
    size = round(scale * width), round(scale * height)
    small = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA).astype(np.uint8)
    image = titled(_on_paper(small, *FILM_SIZE), frame.title, frame.legend)
    return _on_paper(image, FILM_SIZE[0], _FILM_HEIGHT)


def _on_paper(image: Image, width: int, height: int) -> Image:
    """Return an image of a size, extended in white or cut off at the bottom."""
    paper: Image = np.full((height, width, 3), bgr(PAPER), dtype=np.uint8)
    paper[: image.shape[0], : image.shape[1]] = image[:height]
    return paper


def _writer(path: Path, first: Image) -> cv2.VideoWriter:
    height, width = first.shape[:2]
    code = cv2.VideoWriter.fourcc(*"VP80")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, FILM_RATE, (width, height))
    if not writer.isOpened():
        raise FramesError(f"{path}: OpenCV cannot write a VP8 film here")
    return writer
