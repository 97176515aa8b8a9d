"""Files of annotated frames of a run: single pictures, and a sheet of all of them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from msrr_bullet.figures.drawing.canvas import PAPER, Image, bgr, titled, write_png
from msrr_bullet.figures.frames.annotation import AnnotatedFrame, DrawingContext
from msrr_bullet.figures.frames.onboard_frame import draw_onboard
from msrr_bullet.figures.frames.overhead_frame import draw_overhead
from msrr_bullet.log.reader import Log
from msrr_bullet.run_folder import make_folder
from msrr_bullet.timeline.camera_views import CameraView, evenly_spaced, read_camera_views, read_exposures
from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.log_snapshots import read_snapshots
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import NS_PER_S, OVERHEAD, Exposure, onboard_camera

CameraChoice = Literal["overhead", "onboard", "both"]

#: Default number of frames of each camera.
COUNT = 8
SHEET_NAME = "sheet.png"
#: Names of the pictures of frames of any run: camera and number.
_PICTURE = re.compile(rf"({OVERHEAD}|[a-z][a-z0-9_]*_onboard)_[0-9]{{5,}}\.png")
#: Number of columns of the sheet, and width of each [px].
COLUMNS, TILE_WIDTH = 4, 480


class FramesError(MsrrError):
    """The run has no such frames, or earlier ones cannot be deleted."""


class FrameAnnotator:
    """Annotator of the frames of one run."""

    def __init__(self, log: Log, snapshots: Sequence[Snapshot] | None = None) -> None:
        """Read the run; its snapshots may be given where they have been read before.

        Raises:
            MsrrError: The run ended before the first decision.
        """
        self.trial = SnapshotInterpolator(read_snapshots(log) if snapshots is None else snapshots)
        self.context = DrawingContext(log.header.scene, None if log.header.recording else log.header.seed)

    def draw(self, view: CameraView) -> AnnotatedFrame:
        """Annotate a frame."""
        return draw_view(self.context, view, self.trial)

    def draw_latest(self, camera: str, latest: CameraView | None, now_ns: int) -> AnnotatedFrame:
        """Annotate the last frame of a camera; when the next is overdue, its view drawn from truth alone.

        ``latest`` is the last frame up to now; None before the first. In a recording, of which nobody knows
        when the next frame is due, the last one stays.
        """
        cameras = self.context.scene.cameras
        spec = cameras.overhead if camera == OVERHEAD and cameras.overhead is not None else cameras.onboard
        overdue = latest is not None and now_ns - latest.stamp_ns > 1.5 * NS_PER_S / spec.rate_hz
        if latest is None or (overdue and self.context.seed is not None):
            latest = CameraView(Exposure(camera, -1, now_ns), camera_lenses(self.context.scene)[camera])
        return self.draw(latest)

    def onboard_at(self, stamp_ns: int) -> str:
        """Return the camera that a film shows at a time."""
        step = self.trial.at(stamp_ns).watched
        unit = next(iter(self.context.scene.units)) if step is None else step.unit
        return onboard_camera(unit)


def draw_view(context: DrawingContext, view: CameraView, trial: SnapshotInterpolator) -> AnnotatedFrame:
    """Annotate a frame of a trial, which is known at least up to the time of the frame."""
    instant = context.instant(view.exposure)
    snapshot = trial.at(instant)
    if view.exposure.camera == OVERHEAD:
        return draw_overhead(context, view, snapshot, trial.until(instant))
    return draw_onboard(context, view, snapshot)


@dataclass(frozen=True, slots=True)
class WrittenFrames:
    """Files that were written: a picture of each frame, in order of time, and one of all frames."""

    frames: tuple[Path, ...]
    sheet: Path


def write_frames(
    log: Log,
    folder: Path,
    camera: CameraChoice = "both",
    *,
    every_s: float | None = None,
    count: int | None = None,
) -> WrittenFrames:
    """Write annotated frames of a run into a folder. Everything in them comes from the log.

    Once they are written, pictures of an earlier call are deleted from the folder, as the sheet shows none.

    Args:
        log: Log of the run.
        folder: Folder for the files, created if needed. Files of the same names are overwritten.
        camera: Camera whose frames are written.
        every_s: Time between two frames of a camera [s].
        count: Number of frames of each camera, evenly spaced over the run; :data:`COUNT` if neither is given.

    Raises:
        FramesError: Both time and number are given, or the run has no such frames.
        RunFolderError: The folder cannot be written.
    """
    if every_s is not None and count is not None:
        raise FramesError("give --every, the time between frames, or --count, their number, not both")
    selected = _select(log, camera, every_s, COUNT if count is None else count)
    make_folder(folder)
    annotator = FrameAnnotator(log)
    paths: list[Path] = []
    tiles: list[Image] = []
    for view in read_camera_views(log, selected):
        frame = annotator.draw(view)
        name = f"{view.exposure.camera.replace('/', '_')}_{view.exposure.frame:05d}.png"
        paths.append(write_png(folder / name, frame.titled()))
        tiles.append(_tile(frame))
    sheet = write_png(folder / SHEET_NAME, _sheet(tiles))
    try:
        for earlier in set(folder.glob("*.png")) - set(paths):
            if _PICTURE.fullmatch(earlier.name):
                earlier.unlink()
    except OSError as error:
        raise FramesError(f"{error.filename}: cannot be deleted ({error.strerror})") from None
    return WrittenFrames(tuple(paths), sheet)


def _matches(exposure: Exposure, camera: CameraChoice) -> bool:
    return camera == "both" or (exposure.camera == OVERHEAD) == (camera == "overhead")


def _select(log: Log, camera: CameraChoice, every_s: float | None, count: int) -> list[Exposure]:
    if (every_s is not None and not 0.0 < every_s < math.inf) or count < 1:
        raise FramesError("at least one frame, and a finite time above zero between frames, can be asked for")
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
    return [e for exposures in by_camera.values() for e in paced(exposures, round(every_s * NS_PER_S))]


def paced(exposures: Sequence[Exposure], step_ns: int) -> Iterator[Exposure]:
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
