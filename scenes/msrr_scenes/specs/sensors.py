"""Specifications of cameras, wheel encoders and their errors."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from msrr_scenes.geometry.distortion import COEFFICIENTS, Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.rolling_shutter import RollingShutter
from msrr_scenes.specs.spec import (
    Angle,
    Choice,
    Coordinate,
    Distance,
    Grey,
    Latency,
    Probability,
    Rate,
    Spec,
    Turn,
    between,
)

#: Range of horizontal fields of view that can be computed with [deg].
FOV_DEG = (5.0, 150.0)
_FieldOfView = Annotated[float, Field(gt=FOV_DEG[0], lt=FOV_DEG[1])]
#: Edge of a rendered image [px].
_Edge = Annotated[int, Field(ge=16, le=4096)]
#: Coefficient of a lens, which has no unit; real lenses have some tenths.
_Coefficient = Annotated[float, between(-100.0, 100.0)]
#: Focal length [px]; which ones there may be depends on the size of the image.
_FocalLength = Annotated[float, between(1.0, 1e7)]
#: Largest edge of a picture that is calibrated [px], that of the pictures that are read. Those that are
#: rendered are smaller.
_CALIBRATED_PX = 32_768
#: Coordinate of the principal point [px], which lies in or near the image.
_PrincipalPoint = Annotated[float, between(-_CALIBRATED_PX, 2 * _CALIBRATED_PX)]


class CalibrationSpec(Spec):
    """The calibration of a camera, which everybody is told: intrinsics, and distortion by Brown and Conrady.

    Pixels are counted from the centre of the upper left one, as OpenCV and ROS do. A scene file may name a
    file of OpenCV or ROS instead, relative to its own folder: ``calibration: camera.yaml``.
    """

    fx_px: _FocalLength
    """Focal length along the rows [px]."""
    fy_px: _FocalLength
    """Focal length along the columns [px]."""
    cx_px: _PrincipalPoint
    """Column of the principal point [px]."""
    cy_px: _PrincipalPoint
    """Row of the principal point [px]."""
    k1: _Coefficient = 0.0
    """Radial coefficient of the second order."""
    k2: _Coefficient = 0.0
    """Radial coefficient of the fourth order."""
    p1: _Coefficient = 0.0
    """Tangential coefficient along y."""
    p2: _Coefficient = 0.0
    """Tangential coefficient along x."""
    k3: _Coefficient = 0.0
    """Radial coefficient of the sixth order."""
    width_px: int | None = Field(default=None, ge=16, le=_CALIBRATED_PX)
    """Width of the images that were calibrated [px]; null if the file does not say."""
    height_px: int | None = Field(default=None, ge=16, le=_CALIBRATED_PX)
    """Height of the images that were calibrated [px]; null if the file does not say."""

    def lens(self, width: int, height: int) -> Lens:
        """Return the lens of images of a size [px]: an ideal camera, and what the lens does to its image."""
        offset = (self.cx_px - 0.5 * (width - 1), self.cy_px - 0.5 * (height - 1))
        coefficients = {key: getattr(self, key) for key in COEFFICIENTS}
        distortion = Distortion(**coefficients, aspect=self.fy_px / self.fx_px)
        return Lens(PinholeCamera(width, height, self.fx_px, offset), distortion)


class CameraSpec(Spec):
    """The data sheet of a camera: optics, frame rate, latency, noise, and the renderer that stands for it."""

    width_px: _Edge = 640
    """Width of the image [px]."""
    height_px: _Edge = 480
    """Height of the image [px]."""
    hfov_deg: _FieldOfView = 75.0
    """Horizontal field of view of an ideal camera [deg]; a calibration takes its place."""
    calibration: CalibrationSpec | None = None
    """Intrinsics and distortion, by calibration; null for an ideal camera with ``hfov_deg``."""
    rate_hz: Rate = 25.0
    """Frame rate [Hz]."""
    latency_ms: Latency = 40.0
    """Time from the exposure to the arrival of the detections [ms]."""
    noise_grey: Grey = 2.0
    """Standard deviation of the additive read noise [grey levels]."""
    shot_grey: Grey = 0.0
    """Standard deviation of the shot noise at white; it falls to zero at black [grey levels]."""
    blur_px: Annotated[float, between(0.0, 20.0)] = 0.4
    """Standard deviation of the Gaussian lens blur [px]; 20 px blur a tag of the port beyond recognition."""
    exposure_ms: Annotated[float, between(0.0, 100.0)] = 0.0
    """Time for which a row collects light [ms], half of it before the time stamp; what moves is blurred."""
    rolling_shutter_ms: Annotated[float, between(0.0, 100.0)] = 0.0
    """Time from the exposure of the top row to that of the bottom row [ms]; 0 is a global shutter.

    The frame is stamped with the middle of the exposure of its middle row.
    """
    gain: Annotated[float, between(0.05, 20.0)] = 1.0
    """Amplification of light and noise alike; what exceeds white is lost. At 20 the darkest grey is white."""
    gamma: Annotated[float, between(0.2, 5.0)] = 1.0
    """Tone curve behind the gain: a value v between black, 0, and white, 1, becomes v ** (1 / gamma)."""
    vignetting: Annotated[float, between(0.0, 1.0)] = 0.0
    """Share of the light that is lost in the corners; it grows with the squared distance from the centre."""
    light_gradient: Annotated[float, between(0.0, 1.0)] = 0.0
    """Rise of the light, over one width of the image, relative to the light in the middle."""
    light_gradient_deg: Angle = 0.0
    """Direction in which the light rises, from image right towards image down [deg]."""
    jpeg_quality: int | None = Field(default=None, ge=1, le=100)
    """Quality of JPEG compression on the way to the computer; null for uncompressed frames."""
    dropout: Probability = 0.0
    """Probability that a frame is lost between camera and computer."""
    renderer: Choice = Choice(name="raster")
    """Renderer of the noise-free image."""
    samples: int = Field(default=2, ge=1, le=8)
    """Edge of the grid of samples in a pixel over which the renderer ``tiny`` averages; 1 means no
    anti-aliasing. ``raster`` computes what each pixel shows of each surface, and needs none."""
    readout: Literal["windows", "frames"] = "windows"
    """What the sensor can deliver: any windows of a frame, or whole frames only.

    A robot whose onboard camera delivers whole frames reads them whole, and the log has them. Of the overhead
    camera windows are read either way, and are the same.
    """

    @property
    def pinhole(self) -> PinholeCamera:
        """The ideal camera in the place of this one: it has square pixels and does not distort."""
        return self.lens.camera

    @property
    def distortion(self) -> Distortion:
        """What the lens does to the image of the ideal camera, by calibration."""
        return self.lens.distortion

    @property
    def rolling_shutter(self) -> RollingShutter:
        """When the rows of a frame are exposed."""
        return RollingShutter(self.height_px, 1e-3 * self.rolling_shutter_ms)

    @property
    def lens(self) -> Lens:
        """The ideal camera together with the distortion, by calibration."""
        width, height, told = self.width_px, self.height_px, self.calibration
        if told is not None:
            return told.lens(width, height)
        return Lens(PinholeCamera.from_hfov(width, height, math.radians(self.hfov_deg)))


class LocalisationErrorSpec(Spec):
    """Errors of global localisation beyond those of the camera's noise, as they occur outdoors.

    Bias and drift belong to the docking unit alone, so that its pose *relative* to all other bodies is wrong.
    Noise and dropout are drawn for every body independently. The robot knows the standard deviations of the
    noise, as from a data sheet, and none of the other errors.
    """

    bias_x_m: Coordinate = 0.0
    """Constant error of the docking unit's position along x of the world [m]."""
    bias_y_m: Coordinate = 0.0
    """Constant error of the docking unit's position along y of the world [m]."""
    bias_yaw_deg: Angle = 0.0
    """Constant error of the docking unit's heading [deg]."""
    drift_m: Distance = 0.0
    """Random walk of the docking unit's position, each axis [m per square root of a second]."""
    drift_yaw_deg: Turn = 0.0
    """Random walk of the docking unit's heading [deg per square root of a second]."""
    noise_m: Distance = 0.0
    """Standard deviation of every body's position, each axis, drawn per frame [m]."""
    noise_yaw_deg: Turn = 0.0
    """Standard deviation of every body's heading, drawn per frame [deg]."""
    dropout: Probability = 0.0
    """Probability that a body is missing from a frame."""

    def told(self) -> LocalisationErrorSpec:
        """Return what robots are told of it: the standard deviations of the noise."""
        return LocalisationErrorSpec(noise_m=self.noise_m, noise_yaw_deg=self.noise_yaw_deg)


class OverheadCameraSpec(CameraSpec):
    """The camera that looks straight down on the arena; image right is world x, image down is world -y."""

    width_px: _Edge = 1280
    """Width of the image [px]."""
    height_px: _Edge = 960
    """Height of the image [px]."""
    hfov_deg: _FieldOfView = 67.0
    """Horizontal field of view of an ideal camera [deg]; a calibration takes its place."""
    rate_hz: Rate = 10.0
    """Frame rate [Hz]."""
    latency_ms: Latency = 60.0
    """Time from the exposure to the arrival of the detections [ms]."""
    x_m: Coordinate = 0.0
    """Position along x of the world [m]."""
    y_m: Coordinate = 0.0
    """Position along y of the world [m]."""
    height_m: Annotated[float, between(0.5, 50.0)] = 3.0
    """Height above the floor [m]; half a metre clears a unit, and TinyRenderer sees 60 m."""
    localisation: LocalisationErrorSpec = LocalisationErrorSpec()
    """Errors added to the poses that are located in images of this camera; parametric perception has none of
    them."""


class CamerasSpec(Spec):
    """The cameras of a scene."""

    overhead: OverheadCameraSpec | None = None
    """Overhead camera; null for a scene without one."""
    onboard: CameraSpec = CameraSpec()
    """Onboard camera that every unit carries."""


class OdometrySpec(Spec):
    """The wheel encoders of every unit."""

    rate_hz: Rate = 100.0
    """Readings per second [Hz]."""
    ticks_per_turn: int = Field(default=4096, ge=1, le=2**24)
    """Encoder ticks per turn of a wheel; the finest encoders that are sold have 24 bits."""
    scale_error: Annotated[float, between(0.0, 0.2)] = 0.02
    """Standard deviation of each wheel's unknown relative radius error in the readings, drawn once per trial.

    At 0.2 a draw of five deviations is a wheel without a radius. If ``as_built`` has a grade, it is 0 unless
    given: the wheels of a grade have their errors in the motion.
    """
    noise_rad: Annotated[float, between(0.0, 2.0 * math.pi)] = 0.002
    """Standard deviation of a reading's noise per square root of a radian turned [rad]; at most a turn."""


class ParametricSpec(Spec):
    """Perception without pixels: true poses with Gaussian errors, at the camera's rate and latency."""

    sigma_xy_m: Distance = 0.005
    """Standard deviation of the position, each axis [m]."""
    sigma_yaw_deg: Turn = 1.0
    """Standard deviation of the yaw [deg]."""
    sigma_bearing_deg: Turn = 0.1
    """Standard deviation of the bearing of a target edge [deg]."""
