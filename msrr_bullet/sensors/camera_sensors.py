"""The cameras of a trial as sources of sensor messages."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.profiler import Profiler
from msrr_bullet.robot.interface import CameraReader
from msrr_bullet.sensors.camera import Camera
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Detections, Localisation, Pixels, SensorMessage


class RenderedCameraSensor:
    """A rendered camera, whose pixels a program reads."""

    def __init__(
        self,
        camera: Camera,
        profiler: Profiler,
        error_model: Callable[[Detections], Detections] | None = None,
    ) -> None:
        """Let a program read the frames of a camera.

        ``error_model`` adds the errors of a global localisation to detections; None adds none.
        """
        self.camera = camera
        self.name, self.spec, self.frames = camera.name, camera.spec, camera.frames
        self._profiler = profiler
        self._error_model = error_model

    def capture(self, now_ns: int, reader: CameraReader) -> tuple[SensorMessage, ...]:
        """Expose one frame, from which the reader fetches windows, and return its detections."""
        with self._profiler("render"):
            exposure = self.camera.expose(now_ns)
        if exposure is None:
            return ()
        with self._profiler("perception"):
            detections = reader.expose(exposure, self._fetch)
        if detections is None:
            return ()
        return (detections,) if self._error_model is None else (Localisation(self._error_model(detections)),)

    def _fetch(self, window: Window) -> Pixels:
        with self._profiler("render"):
            return self.camera.fetch(window)
