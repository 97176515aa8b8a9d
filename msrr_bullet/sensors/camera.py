"""A rendered camera: it exposes full frames, of which only the windows that are fetched are rendered."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import cast

import numpy as np

from msrr_bullet.render import ExposureRenderer, Instant, Renderer
from msrr_bullet.sensors.camera_motion import CameraMotion
from msrr_bullet.sensors.frame_sequence import FrameSequence
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.sensors.image_response import image_response, jpeg_round_trip, whole_blocks
from msrr_bullet.sensors.shutter import Shutter
from msrr_scenes.as_built import BuiltCamera
from msrr_scenes.errors import MsrrError, SceneError
from msrr_scenes.geometry.distortion import IDEAL_LENS
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Exposure, Pixels
from msrr_scenes.random_streams import stream_key
from msrr_scenes.specs.faults import Fault
from msrr_scenes.specs.sensors import CameraSpec


class CameraError(MsrrError):
    """Pixels are fetched that the camera does not have."""


class Camera:
    """A camera of the simulated world.

    An exposure takes the pose; the pixels of a window are rendered when the window is fetched. This has to
    happen before the next physics tick, because the renderer sees the present state of the world. ``pinhole``
    has the true intrinsics, and ``frames`` clock, losses and latency.
    """

    def __init__(
        self,
        name: str,
        spec: CameraSpec,
        renderer: Renderer,
        pose: Callable[[], SE3],
        seed: int,
        faults: Iterable[Fault] = (),
        built: BuiltCamera | None = None,
        motion: Callable[[], CameraMotion] | None = None,
    ) -> None:
        """Set up a camera.

        If the lens distorts, or the shutter takes time and ``motion`` is given, the renderer has to be an
        :class:`ExposureRenderer`. ``pose`` returns the true ``X_WC`` at the instant of exposure, and
        ``motion`` how camera and bodies move then; None if nothing moves. Noise and dropout use separate
        random streams of the seed, and blackouts of other cameras are ignored. ``built`` has the true
        intrinsics, lens and clock; None if they are those of ``spec``.

        Raises:
            SceneError: The renderer has to be an :class:`ExposureRenderer`, and it is none.
        """
        self.name = name
        self.spec = spec
        built = built or BuiltCamera(spec.pinhole, distortion=spec.distortion)
        self.pinhole: PinholeCamera = built.pinhole
        self._distortion = None if built.distortion == IDEAL_LENS else built.distortion
        self.frames = FrameSequence(name, spec, built, seed, faults)
        self._renderer = renderer
        self._pose = pose
        key = stream_key(seed, f"camera/{name}/noise")
        response = image_response(spec, self.pinhole)
        self._shutter = Shutter(spec, self.pinhole)
        self._observe = None if self._shutter.instantaneous else motion
        exacting = self._distortion is not None or self._observe is not None
        if exacting and not hasattr(renderer, "render_instants"):
            raise SceneError(
                f"cameras.{name.rpartition('/')[2]}.renderer: {spec.renderer.name!r} has no method "
                "render_instants, which draws exposure times and lenses that distort; add it (protocol "
                "ExposureRenderer), or do without these, as as_built: perfect does"
            )
        self._motion: CameraMotion | None = None
        self._noise = ImageNoise(key, spec.blur_px, spec.noise_grey, spec.shot_grey, response)
        self._exposure: Exposure | None = None
        self._X_WC = SE3()
        self._read_out: list[tuple[Window, Pixels]] = []

    def expose(self, stamp_ns: int) -> Exposure | None:
        """Expose the frame that is due at time ``stamp_ns``; return None when the frame is lost.

        Lost frames are numbered too, so that the number of a frame does not depend on losses.
        """
        self._read_out = []
        self._exposure = self.frames.expose(stamp_ns)
        if self._exposure is not None:
            self._X_WC = self._pose()
            self._motion = self._observe() if self._observe else None
        return self._exposure

    def fetch(self, window: Window) -> Pixels:
        """Return the mono8 pixels of a window of the last exposure, shape (height, width), read-only.

        A sensor without regions of interest reads out the whole frame.

        Raises:
            CameraError: The window is empty or not inside the frame, or the last frame was lost.
        """
        if self._exposure is None:
            raise CameraError(f"camera {self.name!r} has no exposure to read")
        if window.width < 1 or window.height < 1 or not self.pinhole.frame.contains(window):
            raise CameraError(
                f"{window} is not part of the {self.pinhole.width} x {self.pinhole.height} frame of camera "
                f"{self.name!r}; intersect it with camera.pinhole.frame first"
            )
        for region, pixels in self._read_out:
            if region.contains(window):
                return _crop(region, pixels, window)
        region = window if self.spec.readout == "windows" else self.pinhole.frame
        quality = self.spec.jpeg_quality
        if quality is not None:
            region = whole_blocks(region, self.pinhole.frame)
        ideal = self._render(region.padded(self._noise.margin))
        pixels = self._noise.read_out(ideal, region, self._exposure.frame)
        if quality is not None:
            pixels = jpeg_round_trip(pixels, quality)
        pixels.setflags(write=False)  # several readers share the array
        self._read_out.append((region, pixels))
        return _crop(region, pixels, window)

    def _render(self, window: Window) -> Pixels:
        """Return the noise-free pixels of a window inside or outside the frame."""
        still = self._motion is None or not self._motion.bodies
        if still and self._distortion is None:
            return self._renderer.render(self.pinhole, self._X_WC, window)
        renderer = cast(ExposureRenderer, self._renderer)  # as __init__ has made sure
        if self._motion is None or still:
            views = [(window, Instant(self._X_WC))]
            return renderer.render_instants(self.pinhole, views, self._distortion)[0]
        exposures = list(self._shutter.exposures(window, self._X_WC, self._motion))
        views = [(e.rows, e.instant) for e in exposures]
        drawn = renderer.render_instants(self.pinhole, views, self._distortion)
        if len(drawn) == 1:
            return drawn[0]
        light = np.zeros((window.height, window.width), dtype=np.float32)
        for exposure, pixels in zip(exposures, drawn, strict=True):
            first = exposure.rows.y - window.y
            light[first : first + exposure.rows.height] += exposure.weights[:, np.newaxis] * pixels
        mean: Pixels = np.rint(light).astype(np.uint8)
        return mean


def _crop(region: Window, pixels: Pixels, window: Window) -> Pixels:
    row, column = window.y - region.y, window.x - region.x
    return pixels[row : row + window.height, column : column + window.width]
