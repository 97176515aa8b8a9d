"""Stills of a run: annotated frames of all cameras at common times, small enough for a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np

from msrr_bullet.figures.frames.annotation import AnnotatedFrame, DrawingContext
from msrr_bullet.figures.frames.frame_files import FrameAnnotator, draw_view, paced
from msrr_bullet.log.reader import Log
from msrr_bullet.timeline.camera_views import CameraView, read_camera_views, read_exposures
from msrr_bullet.timeline.interpolation import SnapshotInterpolator
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.timeline.still import Still
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import NS_PER_S, Exposure
from msrr_scenes.specs.scene import Scene

#: Largest rate of the stills of a camera [Hz], and largest number of those of all cameras together.
STILL_RATE, MAX_STILLS = 3.0, 240
#: Width [px] and quality of a still; an overhead frame is shown at half its size.
STILL_WIDTH, STILL_QUALITY = 640, 60
#: Quality of a still of a running trial.
LIVE_QUALITY = 80
_QUALITY_OF = {"webp": cv2.IMWRITE_WEBP_QUALITY, "jpeg": cv2.IMWRITE_JPEG_QUALITY}
#: Factor by which the time between two stills grows until there are few enough.
_GROWTH = 1.1


def draw_stills(log: Log, snapshots: Sequence[Snapshot]) -> list[Still]:
    """Return stills of all cameras of a run, in order of time; none where the robots read no pixels.

    Raises:
        MsrrError: There is no snapshot.
    """
    exposures = _select(read_exposures(log))
    annotator = FrameAnnotator(log, snapshots)
    with ThreadPoolExecutor(1) as encoder:  # encodes one still while the next one is drawn
        stills = [
            encoder.submit(_still, view.exposure, annotator.draw(view), "webp", STILL_QUALITY)
            for view in read_camera_views(log, exposures)
        ]
        # A signal that interrupts the wait at the end of the block would leave a thread in OpenCV, whose end
        # aborts the process: by then there is nothing left to wait for.
        return [still.result() for still in stills]


def live_stills(scene: Scene, seed: int) -> Callable[[CameraView, SnapshotInterpolator], Still]:
    """Return what draws stills of a running trial, as JPEG: that takes a tenth of the time of WebP."""
    context = DrawingContext(scene, seed)

    def draw(view: CameraView, trial: SnapshotInterpolator) -> Still:
        return _still(view.exposure, draw_view(context, view, trial), "jpeg", LIVE_QUALITY)

    return draw


def _select(exposures: Sequence[Exposure]) -> list[Exposure]:
    """Return few enough exposures: of each camera the first one in every interval of the same length."""
    by_camera: dict[str, list[Exposure]] = {}
    for exposure in exposures:
        by_camera.setdefault(exposure.camera, []).append(exposure)
    interval_s = 1.0 / STILL_RATE
    while True:
        step_ns = round(interval_s * NS_PER_S)
        selected = [exposure for frames in by_camera.values() for exposure in paced(frames, step_ns)]
        if len(selected) <= max(MAX_STILLS, len(by_camera)):
            return selected
        interval_s *= _GROWTH


def _still(exposure: Exposure, frame: AnnotatedFrame, kind: str, quality: int) -> Still:
    height, width = frame.image.shape[:2]
    size = STILL_WIDTH, round(STILL_WIDTH * height / width)
    image = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA)
    encoded, data = cv2.imencode(f".{kind}", image, [_QUALITY_OF[kind], quality])
    if not encoded:
        raise MsrrError(f"OpenCV cannot write {kind} here")
    legend = tuple((key.text, key.colour, key.dashed) for key in frame.legend)
    return Still(
        exposure.camera, exposure.stamp_ns, np.asarray(data).tobytes(), frame.title[-1], legend, kind
    )
