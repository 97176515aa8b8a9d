"""Shading, gain, tone curve and JPEG: closed forms, and a window is the crop of the frame."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from msrr_bullet.sensors.camera import Camera
from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_bullet.sensors.image_response import image_response, jpeg_round_trip, whole_blocks
from msrr_scenes.geometry.pinhole import PinholeCamera, Window
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels
from msrr_scenes.specs.sensors import CameraSpec

ALL_ON = {
    "width_px": 324,  # no multiple of JPEG's blocks
    "height_px": 246,
    "blur_px": 0.8,
    "noise_grey": 3.0,
    "shot_grey": 5.0,
    "gain": 1.4,
    "gamma": 1.3,
    "vignetting": 0.4,
    "light_gradient": 0.5,
    "light_gradient_deg": 30.0,
    "jpeg_quality": 40,
}


class PatternRenderer:
    """A renderer of checks, ramps and saturated patches, a function of the place in the full frame."""

    def render(self, camera: PinholeCamera, X_WC: SE3, window: Window) -> Pixels:
        y, x = np.mgrid[window.y : window.y_end, window.x : window.x_end]
        checks = ((x // 13 + y // 9) % 2) * 255
        pattern = np.where((x // 80 + y // 60) % 2 == 0, checks, (3 * x + 7 * y) % 256)
        return pattern.astype(np.uint8)


def camera(**spec: object) -> Camera:
    return Camera("a/onboard", CameraSpec.model_validate(spec), PatternRenderer(), SE3, seed=3)


def response_of(grey: float, **spec: object) -> NDArray[np.uint8]:
    """What a camera without blur and noise makes of a frame of one grey level."""
    settings = CameraSpec.model_validate({"blur_px": 0.0, "noise_grey": 0.0, **spec})
    sensor = ImageNoise(7, 0.0, 0.0, response=image_response(settings, settings.pinhole))
    frame = settings.pinhole.frame
    return sensor.read_out(np.full((frame.height, frame.width), grey, dtype=np.uint8), frame, 0)


@pytest.mark.parametrize(
    "spec",
    [
        ALL_ON,
        ALL_ON | {"jpeg_quality": None},
        ALL_ON | {"blur_px": 0.0, "noise_grey": 0.0, "shot_grey": 0.0},
        {"width_px": 324, "height_px": 246, "jpeg_quality": 5},
    ],
)
def test_a_window_is_the_crop_of_the_frame_bit_for_bit(spec: dict[str, object]) -> None:
    whole, parts = camera(**spec), camera(**spec)
    rng = np.random.default_rng(3)
    for stamp in range(3):
        whole.expose(stamp)
        parts.expose(stamp)
        frame = whole.fetch(whole.pinhole.frame)
        for _ in range(20):
            w, h = (int(a) for a in rng.integers(1, 90, 2))
            window = Window(int(rng.integers(0, 325 - w)), int(rng.integers(0, 247 - h)), w, h)
            crop = frame[window.y : window.y_end, window.x : window.x_end]
            np.testing.assert_array_equal(parts.fetch(window), crop)


@pytest.mark.parametrize(("gain", "gamma"), [(1.0, 2.2), (0.5, 1.0), (2.0, 1.0), (1.5, 0.7)])
def test_gain_and_tone_curve_have_their_closed_form(gain: float, gamma: float) -> None:
    for grey in (0, 1, 17, 100, 180, 255):
        expected = 255.0 * min(gain * grey / 255.0, 1.0) ** (1.0 / gamma)
        converter = 0.5 / 4095.0  # half a step of twelve bits, through the slope of the tone curve
        slope = (max(grey, 1) * gain / 255.0) ** (1.0 / gamma - 1.0) / gamma
        seen = response_of(grey, gain=gain, gamma=gamma, width_px=16, height_px=16)
        assert np.ptp(seen) == 0
        assert seen[0, 0] == pytest.approx(expected, abs=0.5 + 255.0 * slope * converter)


def test_vignetting_takes_its_share_in_the_corners_and_goes_with_the_square() -> None:
    seen = response_of(200, vignetting=0.5, width_px=160, height_px=120).astype(float)
    y, x = np.mgrid[0:120, 0:160]
    share = ((x - 79.5) ** 2 + (y - 59.5) ** 2) / (80.0**2 + 60.0**2)
    np.testing.assert_allclose(seen, 200.0 * (1.0 - 0.5 * share), atol=0.6)
    assert seen[0, 0] == pytest.approx(100.0, abs=2.0)


@pytest.mark.parametrize("direction", [0.0, 90.0, 215.0])
def test_light_rises_along_its_direction_by_its_share_over_a_width(direction: float) -> None:
    seen = response_of(
        120, light_gradient=0.4, light_gradient_deg=direction, width_px=160, height_px=120
    ).astype(float)
    y, x = np.mgrid[0:120, 0:160]
    angle = math.radians(direction)
    along = ((x - 79.5) * math.cos(angle) + (y - 59.5) * math.sin(angle)) / 160.0
    np.testing.assert_allclose(seen, 120.0 * (1.0 + 0.4 * along), atol=0.6)


def test_light_above_white_is_lost_only_behind_the_gain() -> None:
    """Half the gain keeps what the brighter side of a lit frame has beyond white."""
    lit = {"light_gradient": 1.0, "width_px": 160, "height_px": 16}
    assert (response_of(255, **lit) == 255).mean() > 0.45
    halved = response_of(255, gain=0.5, **lit)[8]
    assert (np.diff(halved.astype(int)) >= 0).all()
    assert halved[-1] == pytest.approx(255 * 0.5 * 1.5, abs=1.0)


def test_noise_grows_with_the_light_that_arrives_and_with_the_gain() -> None:
    """N = 19,200 pixels at each side; 5 standard errors of a variance fail by chance once in 2 million."""
    spec = CameraSpec(gain=2.0, light_gradient=0.5, noise_grey=2.0, shot_grey=6.0, blur_px=0.0)
    sensor = ImageNoise(5, 0.0, 2.0, 6.0, image_response(spec, spec.pinhole))
    seen = sensor.read_out(np.full((480, 640), 60, dtype=np.uint8), spec.pinhole.frame, 0).astype(float)
    for columns in (slice(0, 40), slice(600, 640)):
        light = 60.0 * (1.0 + 0.5 * ((columns.start + 19.5) - 319.5) / 640.0)
        variance = 4.0 * (2.0**2 + 6.0**2 * light / 255.0) + 1.0 / 12.0
        strip = seen[:, columns] - 2.0 * 60.0 * (1.0 + 0.5 * (np.arange(640)[columns] - 319.5) / 640.0)
        assert strip.var() == pytest.approx(variance, rel=5.0 * math.sqrt(2.0 / strip.size))
        assert abs(strip.mean()) < 5.0 * math.sqrt(variance / strip.size)


def test_jpeg_loses_more_at_lower_quality_and_leaves_flat_blocks() -> None:
    frame = Window(0, 0, 64, 48)
    pattern = PatternRenderer().render(PinholeCamera(64, 48, 50.0), SE3(), frame)
    errors = [np.abs(jpeg_round_trip(pattern, q).astype(int) - pattern).mean() for q in (10, 50, 95)]
    assert errors[0] > errors[1] > errors[2] > 0.0
    flat = np.full((16, 16), 133, dtype=np.uint8)
    assert np.abs(jpeg_round_trip(flat, 90).astype(int) - 133).max() <= 1


def test_whole_blocks_end_at_the_frame() -> None:
    frame = Window(0, 0, 324, 246)
    assert whole_blocks(Window(8, 16, 8, 8), frame) == Window(8, 16, 8, 8)
    assert whole_blocks(Window(7, 17, 2, 8), frame) == Window(0, 16, 16, 16)
    assert whole_blocks(Window(323, 245, 1, 1), frame) == Window(320, 240, 4, 6)


def test_an_ideal_response_is_none() -> None:
    spec = CameraSpec(jpeg_quality=50)
    assert image_response(spec, spec.pinhole) is None
