"""Lens blur and image noise: a window is the crop of the frame, and the noise has the stated strength."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from msrr_bullet.sensors.image_noise import ImageNoise
from msrr_scenes.geometry.pinhole import Window

FRAME = Window(0, 0, 640, 480)


def scene_pixels(margin: int) -> NDArray[np.uint8]:
    """A frame with edges, ramps and saturated patches, and the margin around it."""
    rng = np.random.default_rng(11)
    y, x = np.mgrid[-margin : FRAME.height + margin, -margin : FRAME.width + margin]
    checks = ((x // 13 + y // 9) % 2) * 255
    ramp = (x + y) % 256
    return np.where((x // 160 + y // 120) % 2 == 0, checks, ramp + rng.integers(0, 2, x.shape)).astype(
        np.uint8
    )


def cut(pixels: NDArray[np.uint8], window: Window, margin: int) -> NDArray[np.uint8]:
    p = window.padded(margin)
    return pixels[p.y + margin : p.y_end + margin, p.x + margin : p.x_end + margin]


@pytest.mark.parametrize(
    ("blur", "noise", "shot"),
    [(0.0, 0.0, 0.0), (0.4, 2.0, 0.0), (1.0, 8.0, 5.0), (2.5, 0.0, 3.0), (0.0, 40.0, 0.0)],
)
def test_window_is_the_crop_of_the_frame_bit_for_bit(blur: float, noise: float, shot: float) -> None:
    sensor = ImageNoise(key=2**127 + 5, blur_px=blur, noise_grey=noise, shot_grey=shot)
    ideal = scene_pixels(sensor.margin)
    rng = np.random.default_rng(3)
    for frame in (0, 1, 12345):
        whole = sensor.read_out(ideal, FRAME, frame)
        for _ in range(40):
            w, h = (int(a) for a in rng.integers(1, 200, 2))
            window = Window(int(rng.integers(0, 641 - w)), int(rng.integers(0, 481 - h)), w, h)
            part = sensor.read_out(cut(ideal, window, sensor.margin), window, frame)
            crop = whole[window.y : window.y_end, window.x : window.x_end]
            np.testing.assert_array_equal(part, crop)


def test_a_perfect_sensor_changes_nothing() -> None:
    sensor = ImageNoise(key=1, blur_px=0.0, noise_grey=0.0)
    assert sensor.margin == 0
    np.testing.assert_array_equal(sensor.read_out(scene_pixels(0), FRAME, 7), scene_pixels(0))


@pytest.mark.parametrize("sigma", [1.0, 2.0, 8.0])
def test_noise_is_white_and_has_the_stated_sigma(sigma: float) -> None:
    """N = 307,200 pixels a frame; bounds of 5 standard errors fail by chance once in 2 million."""
    sensor = ImageNoise(key=99, blur_px=0.0, noise_grey=sigma)
    grey = np.full((480, 640), 128, dtype=np.uint8)
    a, b = (sensor.read_out(grey, FRAME, k).astype(float) - 128.0 for k in (4, 5))
    n = a.size
    variance = sigma**2 + 1.0 / 12.0  # and the rounding to whole grey levels
    assert abs(a.mean()) < 5.0 * np.sqrt(variance / n)
    assert a.var() == pytest.approx(variance, rel=5.0 * np.sqrt(2.0 / n))
    assert abs(np.mean(a**4) / a.var() ** 2 - 3.0) < 5.0 * np.sqrt(24.0 / n)
    for one, other in ((a, b), (a[:, 1:], a[:, :-1]), (a[1:], a[:-1])):
        assert abs(np.mean(one * other)) / variance < 5.0 / np.sqrt(one.size)


@pytest.mark.parametrize("grey", [40, 100, 192])
def test_the_variance_of_shot_noise_goes_with_the_light(grey: int) -> None:
    """N = 307,200 pixels; 5 standard errors of the variance fail by chance once in 2 million."""
    sensor = ImageNoise(key=11, blur_px=0.0, noise_grey=2.0, shot_grey=6.0)
    lifted = np.full((480, 640), grey, dtype=np.uint8)
    seen = sensor.read_out(lifted, FRAME, 3).astype(float) - grey
    variance = 2.0**2 + 6.0**2 * grey / 255.0 + 1.0 / 12.0
    assert seen.var() == pytest.approx(variance, rel=5.0 * np.sqrt(2.0 / seen.size))


def test_noise_depends_on_camera_key_and_frame_and_on_nothing_else() -> None:
    grey = np.full((480, 640), 128, dtype=np.uint8)

    def read(key: int, frame: int) -> NDArray[np.uint8]:
        return ImageNoise(key, 0.0, 3.0).read_out(grey, FRAME, frame)

    np.testing.assert_array_equal(read(5, 9), read(5, 9))
    assert (read(5, 9) != read(6, 9)).mean() > 0.5
    assert (read(5, 9) != read(5, 10)).mean() > 0.5


def test_noise_saturates_and_never_wraps_around() -> None:
    sensor = ImageNoise(key=3, blur_px=0.0, noise_grey=30.0)
    black = sensor.read_out(np.zeros((480, 640), dtype=np.uint8), FRAME, 0)
    white = sensor.read_out(np.full((480, 640), 255, dtype=np.uint8), FRAME, 0)
    assert black.max() < 200
    assert white.min() > 55
    assert (black == 0).mean() == pytest.approx(0.5, abs=0.02)
    assert (white == 255).mean() == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("sigma", [0.4, 0.6, 1.0, 2.0])
def test_blur_spreads_an_edge_by_its_sigma(sigma: float) -> None:
    """The derivative of a blurred step is the blur's kernel; grey levels are whole, hence the tolerance."""
    sensor = ImageNoise(key=3, blur_px=sigma, noise_grey=0.0)
    window = Window(0, 0, 64, 8)
    ideal = np.zeros((8 + 2 * sensor.margin, 64 + 2 * sensor.margin), dtype=np.uint8)
    ideal[:, 32 + sensor.margin :] = 250
    row = sensor.read_out(ideal, window, 0)[4].astype(float)
    kernel = np.diff(row) / 250.0
    at = np.arange(63) + 0.5
    assert kernel.sum() == pytest.approx(1.0)
    middle = (kernel * at).sum()
    assert middle == pytest.approx(31.5, abs=0.02)
    assert np.sqrt((kernel * (at - middle) ** 2).sum()) == pytest.approx(sigma, abs=0.08)


def test_pixels_that_do_not_fill_the_padded_window_are_refused() -> None:
    sensor = ImageNoise(key=3, blur_px=1.0, noise_grey=0.0)
    with pytest.raises(ValueError, match="margin of 3"):
        sensor.read_out(np.zeros((10, 10), dtype=np.uint8), Window(0, 0, 10, 10), 0)
