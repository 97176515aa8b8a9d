"""Camera frames as far as the robot read them, collected from the log."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from msrr_bullet.log.records import CameraWindow
from msrr_scenes.camera_lenses import camera_lenses
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.messages import (
    OVERHEAD,
    Action,
    Detections,
    Exposure,
    Localisation,
    Phase,
    Pixels,
    TagDetection,
)
from msrr_scenes.specs.scene import Scene

if TYPE_CHECKING:  # a running trial collects views without reading a log
    from msrr_bullet.log.reader import Log

#: Grey level of pixels that perception did not read.
UNREAD = 200


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """What perception read of one camera frame.

    Attributes:
        exposure: Camera, number of the frame and time of exposure.
        lens: Calibration of the camera.
        windows: Pixel windows that were read, each with its mono8 pixels (height, width).
        tags: Detected tags, corners in pixels of the ideal camera. With localisation errors in the scene, the
            corners are where the localisation service reports them.
        complete: Whether its tags had been reported when the run ended.
    """

    exposure: Exposure
    lens: Lens
    windows: Sequence[tuple[Window, Pixels]] = ()
    tags: Sequence[TagDetection] = ()
    complete: bool = True

    @property
    def stamp_ns(self) -> int:
        """Time of exposure."""
        return self.exposure.stamp_ns

    @property
    def camera(self) -> PinholeCamera:
        """The ideal camera, as which the frame is shown."""
        return self.lens.camera

    @property
    def read_share(self) -> float:
        """Share of the pixels of the frame that were read."""
        read = np.zeros((self.camera.height, self.camera.width), dtype=np.bool_)
        for window, _ in self.windows:
            read[window.y : window.y_end, window.x : window.x_end] = True
        return float(read.mean())

    def mosaic(self) -> tuple[Pixels, NDArray[np.bool_]]:
        """Return the undistorted frame and a mask of what was read; the rest is :data:`UNREAD`."""
        frame = np.full((self.camera.height, self.camera.width), UNREAD, dtype=np.uint8)
        read = np.zeros(frame.shape, dtype=np.bool_)
        for window, pixels in self.windows:
            region = np.s_[window.y : window.y_end, window.x : window.x_end]
            frame[region], read[region] = pixels, True
        if not self.lens.distorts:
            return frame, read
        columns, rows = _places(self.lens)
        mask = cv2.remap(read.astype(np.uint8), columns, rows, cv2.INTER_NEAREST) > 0
        shown = cv2.remap(frame, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.where(mask, shown, np.uint8(UNREAD)), mask


@runtime_checkable
class CameraViewer(Protocol):
    """Display of a running trial that shows camera views as well. It has no influence on the trial."""

    def wants(self, camera: str) -> bool:
        """Return whether a view of a camera would be shown now."""

    def show_view(self, view: CameraView) -> None:
        """Show what was read of a frame."""


class CameraViewCollector:
    """Collects the views of a running trial: one is complete when its tags have been reported."""

    def __init__(self, scene: Scene) -> None:
        """Begin before the first message of a trial of a scene."""
        self._lenses = camera_lenses(scene)
        self._windows: dict[Exposure, list[tuple[Window, Pixels]]] = {}

    def add_window(self, exposure: Exposure, window: Window, pixels: Pixels) -> None:
        """Take in the pixels, shape (height, width), that were read from a window of a frame."""
        self._windows.setdefault(exposure, []).append((window, pixels.copy()))

    def add(self, message: object) -> CameraView | None:
        """Take in a message of the trial, and return the view that it completes."""
        if isinstance(message, Localisation):
            message = message.detections
        if not isinstance(message, Detections) or message.exposure not in self._windows:
            return None
        exposure, windows = message.exposure, self._windows[message.exposure]
        # What was exposed before is not reported any more.
        self._windows = {
            other: read
            for other, read in self._windows.items()
            if other.camera != exposure.camera or other.stamp_ns > exposure.stamp_ns
        }
        return CameraView(exposure, self._lenses[exposure.camera], windows, message.tags)


@lru_cache(maxsize=4)
def _places(lens: Lens) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return column and row in the frame of every pixel of the ideal camera; -1 where it shows nothing."""
    rows, columns = np.mgrid[: lens.camera.height, : lens.camera.width].astype(np.float64)
    ideal = np.stack([columns, rows], axis=-1)
    places = np.where(lens.shows(ideal)[..., np.newaxis], lens.distorted(ideal), -1.0).astype(np.float32)
    return places[..., 0], places[..., 1]


def read_exposures(log: Log) -> list[Exposure]:
    """Return every frame that reached the computer, in order."""
    return [exposure for _, exposure in log.messages(Exposure, "/camera/*")]


def read_camera_views(log: Log, exposures: Collection[Exposure]) -> Iterator[CameraView]:
    """Yield the views of the given frames in the order of reading. One view is in memory at a time."""
    exposures = frozenset(exposures)
    # Detections are logged later than the pixels, by the latency.
    tags = {found.exposure: found.tags for found in _detections(log) if found.exposure in exposures}
    lenses = camera_lenses(log.header.scene)
    current: Exposure | None = None
    windows: list[tuple[Window, Pixels]] = []

    def view(exposure: Exposure) -> CameraView:
        found = tags.get(exposure)
        return CameraView(exposure, lenses[exposure.camera], windows, found or (), complete=found is not None)

    for record in log.records("/camera/*"):
        if record.kind is Exposure:
            if current is not None:
                yield view(current)
            current = record.message if record.message in exposures else None
            windows = []
        elif current is not None and record.kind is CameraWindow:
            windows.append((record.message.window, record.message.pixels))
    if current is not None:
        yield view(current)


def _detections(log: Log) -> Iterator[Detections]:
    for record in log.records("/perception/*", "/sensors/*/localisation"):
        if record.kind is Detections:
            yield record.message
        elif record.kind is Localisation:
            yield record.message.detections


def docking_views(log: Log) -> tuple[CameraView, ...]:
    """Return at most three frames of the onboard camera in which a tag was detected, evenly spaced.

    The first is the first such frame of the trial, the last is the last one of the docking phase.
    """
    docking = [a.stamp_ns for _, a in log.messages(Action, "/control/*") if a.phase is Phase.DOCK]
    detected = [
        d.exposure
        for _, d in log.messages(Detections, "/perception/*")
        if d.tags and d.exposure.camera != OVERHEAD and (not docking or d.exposure.stamp_ns <= docking[-1])
    ]
    return tuple(read_camera_views(log, evenly_spaced(detected, 3)))


def evenly_spaced(exposures: Sequence[Exposure], count: int) -> list[Exposure]:
    """Return at most ``count`` of the exposures, evenly spaced, the first and the last among them."""
    count, last = min(count, len(exposures)), len(exposures) - 1
    indices = sorted({round(i * last / max(count - 1, 1)) for i in range(count)})
    return [exposures[i] for i in indices]
