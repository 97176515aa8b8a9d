"""Specifications of cameras, encoders and of what may be wrong with them."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.specs.spec import Choice, Finite, NonNegative, Positive, Probability, Spec


class CameraSpec(Spec):
    """A camera as a sensor: optics, rate, latency, noise, blur, dropped frames, renderer.

    Attributes:
        noise_grey: Standard deviation of the additive read noise [grey levels].
        shot_grey: Standard deviation of the shot noise at white [grey levels]; less in the dark.
        blur_px: Standard deviation of the Gaussian lens blur [px].
        dropout: Probability that a frame is lost between camera and computer.
        samples: Edge of the sub-pixel grid the renderer averages over (1: no anti-aliasing).
        readout: What the sensor can deliver: any windows of a frame, or nothing but whole frames.
    """

    width_px: int = Field(default=640, ge=16, le=4096)
    height_px: int = Field(default=480, ge=16, le=4096)
    hfov_deg: float = Field(default=75.0, gt=5.0, lt=150.0)
    rate_hz: Positive = 25.0
    latency_ms: NonNegative = 40.0
    noise_grey: NonNegative = 2.0
    shot_grey: NonNegative = 0.0
    blur_px: NonNegative = 0.4
    dropout: Probability = 0.0
    renderer: Choice = Choice(name="raster")
    samples: int = Field(default=2, ge=1, le=8)
    readout: Literal["windows", "frames"] = "windows"

    @property
    def pinhole(self) -> PinholeCamera:
        """Intrinsics."""
        return PinholeCamera.from_hfov(self.width_px, self.height_px, math.radians(self.hfov_deg))


class LocalisationErrorSpec(Spec):
    """What global localisation gets wrong beyond the camera's own noise, as it does outdoors.

    Bias and drift belong to the docking unit alone, so that its pose *relative* to all others is wrong.
    Noise and dropout strike every body by itself. The robot knows the noise, as from a data sheet, and
    nothing of the rest.

    Attributes:
        bias_x_m: Constant error of the docking unit's position, along x of the world.
        bias_y_m: The same along y.
        bias_yaw_deg: Constant error of its heading.
        drift_m: Random walk of its position, each axis [m per square root of a second].
        drift_yaw_deg: Random walk of its heading [deg per square root of a second].
        noise_m: Standard deviation of every body's position, each axis, drawn anew per frame.
        noise_yaw_deg: The same of every body's heading.
        dropout: Probability that a body goes unnoticed in a frame.
    """

    bias_x_m: Finite = 0.0
    bias_y_m: Finite = 0.0
    bias_yaw_deg: Finite = 0.0
    drift_m: NonNegative = 0.0
    drift_yaw_deg: NonNegative = 0.0
    noise_m: NonNegative = 0.0
    noise_yaw_deg: NonNegative = 0.0
    dropout: Probability = 0.0


class OverheadCameraSpec(CameraSpec):
    """The camera that looks straight down on the arena; image right is world x, image down is world -y."""

    width_px: int = Field(default=1280, ge=16, le=4096)
    height_px: int = Field(default=960, ge=16, le=4096)
    hfov_deg: float = Field(default=67.0, gt=5.0, lt=150.0)
    rate_hz: Positive = 10.0
    latency_ms: NonNegative = 60.0
    x_m: Finite = 0.0
    y_m: Finite = 0.0
    height_m: Positive = 3.0
    localisation: LocalisationErrorSpec = LocalisationErrorSpec()


class CamerasSpec(Spec):
    """The overhead camera (optional) and the onboard camera that every unit carries."""

    overhead: OverheadCameraSpec | None = None
    onboard: CameraSpec = CameraSpec()


class OdometrySpec(Spec):
    """Wheel encoders.

    Attributes:
        rate_hz: Readings per second.
        ticks_per_turn: Resolution.
        scale_error: Standard deviation of each wheel's unknown radius error, drawn once per trial (slip).
        noise_rad: Standard deviation of the reading's noise per square root of a radian turned.
    """

    rate_hz: Positive = 100.0
    ticks_per_turn: int = Field(default=4096, ge=1)
    scale_error: NonNegative = 0.02
    noise_rad: NonNegative = 0.002


class TagsSpec(Spec):
    """AprilTag family and the edge of each kind's black square."""

    family: Literal["tag36h11"] = "tag36h11"
    top_m: Positive = 0.12
    side_m: Positive = 0.05
    mast_m: Positive = 0.04


class ParametricSpec(Spec):
    """Perception without pixels: true poses with Gaussian errors, at the camera's rate and latency."""

    sigma_xy_m: NonNegative = 0.005
    sigma_yaw_deg: NonNegative = 1.0
    sigma_bearing_deg: NonNegative = 0.1
