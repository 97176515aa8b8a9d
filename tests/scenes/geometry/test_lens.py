"""The ideal image of a calibrated lens: against OpenCV, there and back, and where the frame ends in it."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from msrr_scenes.geometry.distortion import COEFFICIENTS, Distortion
from msrr_scenes.geometry.lens import Lens, frame_outline
from msrr_scenes.geometry.pinhole import PinholeCamera

CAMERA = PinholeCamera(640, 480, 417.0, (6.5, -5.5))
LENSES = (
    Lens(CAMERA),
    Lens(CAMERA, Distortion(aspect=0.97)),
    Lens(CAMERA, Distortion(k1=-0.2, k2=0.04, p1=0.002, p2=-0.001, aspect=1.02)),
    Lens(CAMERA, Distortion(k1=0.2, k2=-0.03, k3=0.004, p1=-0.003)),
)


def frame_pixels(count: int = 300) -> np.ndarray:
    return np.random.default_rng(2).uniform((-0.5, -0.5), (639.5, 479.5), (count, 2))


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_pixels_are_those_of_opencv(lens: Lens) -> None:
    K = CAMERA.matrix()
    K[1, 1] *= lens.distortion.aspect
    rays = np.column_stack([np.random.default_rng(3).uniform(-0.7, 0.7, (300, 2)), np.ones(300)])
    k = np.array([getattr(lens.distortion, key) for key in COEFFICIENTS])
    expected = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, k)[0][:, 0]
    np.testing.assert_allclose(lens.distorted(CAMERA.project(rays)), expected, atol=1e-9)


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_what_is_undistorted_is_shown_where_it_was(lens: Lens) -> None:
    pixels = frame_pixels().reshape(60, 5, 2)
    ideal = lens.undistorted(pixels)
    np.testing.assert_allclose(lens.distorted(ideal), pixels, atol=1e-6)
    assert lens.shows(ideal).all()
    assert not lens.shows(lens.undistorted(pixels - [642.0, 0.0])).any()
    bounds = lens.bounds
    assert (ideal >= [bounds.x - 0.5, bounds.y - 0.5]).all()
    assert (ideal <= [bounds.x_end - 0.5, bounds.y_end - 0.5]).all()


def test_what_the_polynomial_folds_back_into_the_frame_is_not_shown() -> None:
    """r (1 - 0.14 r^2) rises up to r = 1.54 and is zero again at 2.67; the frame reaches to 0.96."""
    lens = Lens(PinholeCamera(640, 480, 417.0), Distortion(k1=-0.14))
    r, angle = np.meshgrid(np.linspace(1.55, 2.65, 40), np.linspace(-math.pi, math.pi, 72))
    far = lens.camera.project(np.stack([r * np.cos(angle), r * np.sin(angle), np.ones_like(r)], axis=-1))
    assert lens.camera.contains(lens.distorted(far)).mean() > 0.4
    assert not lens.shows(far).any()


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_between_the_inner_bounds_the_frame_shows_all_and_each_of_them_touches_its_border(lens: Lens) -> None:
    left, right, top, bottom = lens.inner_bounds
    columns, rows = (np.linspace(a + 0.05, b - 0.05, 200) for a, b in ((left, right), (top, bottom)))
    assert lens.shows(np.stack(np.meshgrid(columns, rows), axis=-1)).all()
    along = np.linspace(-200.0, 800.0, 4001)
    for axis, border, at in ((0, -0.5, left), (0, 639.5, right), (1, -0.5, top), (1, 479.5, bottom)):
        line = np.full((len(along), 2), at)
        line[:, 1 - axis] = along
        shown = lens.distorted(line)
        of_frame = (shown[:, 1 - axis] >= -0.5) & (shown[:, 1 - axis] <= (479.5, 639.5)[axis])
        assert np.abs(shown[of_frame, axis] - border).min() < 0.05


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_standard_deviations_are_those_of_samples(lens: Lens) -> None:
    """200,000 samples of a standard deviation: 0.16 % each, and 2 % are 12 of them."""
    rng = np.random.default_rng(4)
    ideal, sigma = lens.undistorted(frame_pixels(6)), rng.uniform(0.1, 0.5, (6, 2))
    samples = lens.distorted(ideal + sigma * rng.standard_normal((200_000, 6, 2)))
    np.testing.assert_allclose(lens.distorted_sigma(ideal, sigma), samples.std(axis=0), rtol=0.02)


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_the_field_of_view_ends_at_the_border_of_the_frame(lens: Lens) -> None:
    to_left, to_right = lens.field_of_view
    row = CAMERA.cy
    edges = [
        [CAMERA.cx - CAMERA.focal * math.tan(to_left), row],
        [CAMERA.cx + CAMERA.focal * math.tan(to_right), row],
    ]
    shown = lens.distorted(np.array(edges))
    np.testing.assert_allclose(shown[:, 0], [-0.5, 639.5], atol=0.01)
    assert lens.half_fov == min(to_left, to_right)


def test_the_outline_of_a_frame_runs_around_it() -> None:
    outline = frame_outline(PinholeCamera(64, 48, 40.0).frame)
    on_side = np.isin(outline[:, 0], [-0.5, 63.5]) | np.isin(outline[:, 1], [-0.5, 47.5])
    assert on_side.all()
    assert np.abs(outline - np.roll(outline, 1, axis=0)).max() <= 8.0
    assert {(-0.5, -0.5), (63.5, -0.5), (63.5, 47.5), (-0.5, 47.5)} <= set(map(tuple, outline.tolist()))
