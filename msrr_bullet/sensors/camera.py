"""A camera: exposes full frames, renders only the windows that are fetched from them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from msrr_bullet.render.renderer import Renderer
from msrr_bullet.sensors.frame_dropout import FrameDropout
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Exposure, Pixels
from msrr_scenes.random_streams import stream, stream_key
from msrr_scenes.specs.faults import Fault
from msrr_scenes.specs.sensors import CameraSpec


class CameraError(MsrrError):
    """Pixels asked for that the camera does not have."""


@dataclass(slots=True)
class CameraStats:
    """What a camera has done so far, and what it cost.

    Attributes:
        exposures: Frames that were due.
        lost: Frames of those that never reached the computer.
        windows: Windows rendered.
        reused: Windows answered from what was rendered of the same exposure.
        pixels: Pixels rendered.
        render_ns: Wall time of the renderer.
        sensor_ns: Wall time of blur and noise.
    """

    exposures: int = 0
    lost: int = 0
    windows: int = 0
    reused: int = 0
    pixels: int = 0
    render_ns: int = 0
    sensor_ns: int = 0


class Camera:
    """A camera of the simulated world.

    When it exposes, the pose is taken and the frame exists in principle; pixels come into being when a
    window is fetched. That has to happen before the world moves on: the renderer sees the world as it
    stands.
    """

    def __init__(
        self,
        name: str,
        spec: CameraSpec,
        renderer: Renderer,
        pose: Callable[[], SE3],
        seed: int,
        faults: Iterable[Fault] = (),
    ) -> None:
        """Set up a camera.

        Args:
            name: ``overhead`` or ``<unit>/onboard``.
            spec: Optics, noise, blur and dropout of the camera.
            renderer: Renders the noise-free pixels.
            pose: Returns the true ``X_WC`` at the instant of exposure.
            seed: Seed of the trial; noise and dropout have streams of their own.
            faults: Faults of the scene; blackouts of other cameras are ignored.
        """
        self.name = name
        self.spec = spec
        self.pinhole: PinholeCamera = spec.pinhole
        self.stats = CameraStats()
        self._renderer = renderer
        self._pose = pose
        key = stream_key(seed, f"camera/{name}/noise")
        self._sensor = ImageNoise(key, spec.blur_px, spec.noise_grey, spec.shot_grey)
        rng = stream(seed, f"camera/{name}/dropout")
        self._dropout = FrameDropout(name, spec.dropout, rng, faults)
        self._exposure: Exposure | None = None
        self._X_WC = SE3()
        self._read_out: list[tuple[Window, Pixels]] = []

    def expose(self, stamp_ns: int) -> Exposure | None:
        """Take the frame that is due at ``stamp_ns``; None when it is lost on its way to the computer.

        Lost frames are numbered too, so that the number of a frame does not depend on earlier losses.
        """
        frame, lost = self._dropout.next_frame(stamp_ns)
        self.stats.exposures += 1
        self._read_out = []
        if lost:
            self.stats.lost += 1
            self._exposure = None
            return None
        self._X_WC = self._pose()
        self._exposure = Exposure(self.name, frame, stamp_ns)
        return self._exposure

    def fetch(self, window: Window) -> Pixels:
        """Return the mono8 pixels of a window of the exposure at hand, shape (height, width), read-only.

        A sensor that delivers whole frames only reads out the whole frame for it.

        Raises:
            CameraError: The window is empty or leaves the frame, or there is no exposure to read.
        """
        if self._exposure is None:
            raise CameraError(f"camera {self.name!r} has no exposure to read")
        if window.width < 1 or window.height < 1 or not self.pinhole.frame.contains(window):
            raise CameraError(
                f"{window} is not part of the {self.pinhole.width} x {self.pinhole.height} frame of camera "
                f"{self.name!r}; intersect it with camera.pinhole.frame first"
            )
        for have, pixels in self._read_out:
            if have.contains(window):
                self.stats.reused += 1
                return _crop(have, pixels, window)
        whole = window if self.spec.readout == "windows" else self.pinhole.frame
        pixels = self._render(whole, self._exposure.frame)
        self._read_out.append((whole, pixels))
        return _crop(whole, pixels, window)

    @property
    def read_out(self) -> tuple[tuple[Window, Pixels], ...]:
        """What was read out of the exposure at hand so far, in order."""
        return tuple(self._read_out)

    def _render(self, window: Window, frame: int) -> Pixels:
        start = time.perf_counter_ns()
        ideal = self._renderer.render(self.pinhole, self._X_WC, window.padded(self._sensor.margin))
        rendered = time.perf_counter_ns()
        pixels = self._sensor.read_out(ideal, window, frame)
        pixels.setflags(write=False)  # handed out to several readers, and to the log
        self.stats.windows += 1
        self.stats.pixels += window.area
        self.stats.render_ns += rendered - start
        self.stats.sensor_ns += time.perf_counter_ns() - rendered
        return pixels


def _crop(have: Window, pixels: Pixels, window: Window) -> Pixels:
    row, column = window.y - have.y, window.x - have.x
    return pixels[row : row + window.height, column : column + window.width]
