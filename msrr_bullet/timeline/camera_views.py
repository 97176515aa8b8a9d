"""What the robot read of a camera's frames, gathered from the log."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.log.reader import Log
from msrr_bullet.log.records import CameraWindow
from msrr_perception.pose.overhead_model import OVERHEAD
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.messages import Action, Detections, Exposure, Localisation, Phase, Pixels, TagDetection
from msrr_scenes.specs.scene import Scene

#: Grey level of the pixels that perception never asked for.
UNREAD = 200


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """What perception read of one frame.

    Attributes:
        exposure: Camera, frame and time of exposure.
        camera: Its optics.
        windows: The windows read, each with its mono8 pixels (height, width).
        tags: What was detected, corners in full-frame pixels; under a model of localisation errors, where
            the localisation service believes them to be.
    """

    exposure: Exposure
    camera: PinholeCamera
    windows: Sequence[tuple[Window, Pixels]] = ()
    tags: Sequence[TagDetection] = ()

    @property
    def stamp_ns(self) -> int:
        """Time of exposure."""
        return self.exposure.stamp_ns

    def mosaic(self) -> tuple[Pixels, NDArray[np.bool_]]:
        """Return the frame as far as it was read (the rest is :data:`UNREAD`), and which pixels were."""
        frame = np.full((self.camera.height, self.camera.width), UNREAD, dtype=np.uint8)
        read = np.zeros(frame.shape, dtype=np.bool_)
        for window, pixels in self.windows:
            place = np.s_[window.y : window.y_end, window.x : window.x_end]
            frame[place], read[place] = pixels, True
        return frame, read


def optics(scene: Scene, camera: str) -> PinholeCamera:
    """Return the optics of a camera by its name in exposures.

    Raises:
        SceneError: The overhead camera of a scene that has none.
    """
    if camera != OVERHEAD:
        return scene.cameras.onboard.pinhole
    if scene.cameras.overhead is None:
        raise SceneError("cameras.overhead: this scene has no overhead camera")
    return scene.cameras.overhead.pinhole


def exposures(log: Log) -> list[Exposure]:
    """Return every frame that reached the computer, in order."""
    return [exposure for _, exposure in log.messages(Exposure, "/camera/*")]


def camera_views(log: Log, wanted: Collection[Exposure]) -> Iterator[CameraView]:
    """Yield the frames that are ``wanted``, in the order in which they were read; one at a time in memory."""
    wanted = frozenset(wanted)
    tags = {
        found.exposure: found.tags
        for found in _findings(log)
        if found.exposure in wanted  # they come later than the pixels, by the latency
    }
    scene = log.header.scene
    at_hand: Exposure | None = None
    windows: list[tuple[Window, Pixels]] = []

    def view(exposure: Exposure) -> CameraView:
        return CameraView(exposure, optics(scene, exposure.camera), windows, tags.get(exposure, ()))

    for record in log.records("/camera/*"):
        if record.kind is Exposure:
            if at_hand is not None:
                yield view(at_hand)
            at_hand = record.message if record.message in wanted else None
            windows = []
        elif at_hand is not None and record.kind is CameraWindow:
            windows.append((record.message.window, record.message.pixels))
    if at_hand is not None:
        yield view(at_hand)


def _findings(log: Log) -> Iterator[Detections]:
    for record in log.records("/perception/*", "/sensors/*/localisation"):
        if record.kind is Detections:
            yield record.message
        elif record.kind is Localisation:
            yield record.message.detections


def docking_views(log: Log, count: int = 3) -> tuple[CameraView, ...]:
    """Return ``count`` frames of the onboard camera, spread over the docking phase, tags included.

    The first is the first frame with a tag in it, the last the one nearest to the end of the docking phase.
    """
    docking = [a.stamp_ns for _, a in log.messages(Action, "/control/*") if a.phase is Phase.DOCK]
    seen = [
        d.exposure
        for _, d in log.messages(Detections, "/perception/*")
        if d.tags and d.exposure.camera != OVERHEAD and (not docking or d.exposure.stamp_ns <= docking[-1])
    ]
    return tuple(camera_views(log, spread(seen, count)))


def spread(exposures: Sequence[Exposure], count: int) -> list[Exposure]:
    """Return at most ``count`` of the exposures, the first and the last among them, evenly spread."""
    last = len(exposures) - 1
    places = sorted({round(i * last / max(count - 1, 1)) for i in range(count)}) if exposures else []
    return [exposures[i] for i in places]
