"""Lens distortion and its inverse, against OpenCV, and where there is none."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from msrr_scenes.geometry.distortion import COEFFICIENTS, IDEAL_LENS, Distortion, fold_radius, has_inverse
from msrr_scenes.geometry.pinhole import PinholeCamera

CAMERA = PinholeCamera.from_hfov(640, 480, math.radians(75.0))

#: Largest coefficients with which a frame of 75 deg has an inverse, or nearly so, and mixtures.
LENSES = (
    Distortion(k1=-0.14),
    Distortion(k1=0.5),
    Distortion(k1=0.2, k2=-0.05, k3=0.01, p1=0.01, p2=-0.01),
    Distortion(k1=-0.3, k2=0.15, p1=0.003),
)


def pixels(count: int = 500) -> np.ndarray:
    return np.random.default_rng(3).uniform((-8.5, -8.5), (647.5, 487.5), (count, 2))


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_pixels_are_those_of_opencv(lens: Distortion) -> None:
    ideal = pixels()
    coefficients = np.array([getattr(lens, key) for key in COEFFICIENTS])
    expected = cv2.projectPoints(CAMERA.rays(ideal), np.zeros(3), np.zeros(3), CAMERA.matrix(), coefficients)[
        0
    ]
    np.testing.assert_allclose(lens.lens_pixels(CAMERA, ideal), expected[:, 0], atol=1e-9)


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_the_inverse_of_a_lens_leads_back(lens: Distortion) -> None:
    assert has_inverse(CAMERA, lens)
    shown = pixels()
    back = lens.lens_pixels(CAMERA, lens.ideal_pixels(CAMERA, shown))
    np.testing.assert_allclose(back, shown, atol=1e-6)


@pytest.mark.parametrize("size", [1, 7, 500])
def test_the_inverse_of_a_point_depends_on_no_other_point(size: int) -> None:
    shown = pixels()
    alone = np.concatenate(
        [LENSES[2].ideal_pixels(CAMERA, part) for part in np.split(shown, range(size, 500, size))]
    )
    np.testing.assert_array_equal(alone, LENSES[2].ideal_pixels(CAMERA, shown))


@pytest.mark.parametrize("k1", [-0.2, -0.5])
def test_a_lens_without_an_inverse_in_the_frame_is_found(k1: float) -> None:
    """k1 < 0 shows nothing beyond 2 / 3 / sqrt(-3 k1) focal lengths; the frame reaches to 0.96."""
    assert 2.0 / 3.0 / math.sqrt(-3.0 * k1) < math.hypot(320, 240) / CAMERA.focal
    assert not has_inverse(CAMERA, Distortion(k1=k1))
    radius = fold_radius(CAMERA, Distortion(k1=k1))
    assert radius is not None
    diagonal = math.hypot(8.0, 8.0)  # of the nodes that are tested [px]
    assert abs(radius - CAMERA.focal * 2.0 / 3.0 / math.sqrt(-3.0 * k1)) < diagonal


def test_an_ideal_lens_changes_nothing() -> None:
    np.testing.assert_allclose(IDEAL_LENS.ideal_pixels(CAMERA, pixels()), pixels(), atol=1e-9)


def test_lenses_that_are_taken_to_have_an_inverse_have_one() -> None:
    """Whatever the shortcut of has_inverse accepts, the search for folds accepts; it spares most of them."""
    rng, slight = np.random.default_rng(4), 0
    for camera in (CAMERA, PinholeCamera.from_hfov(640, 480, math.radians(140.0))):
        for _ in range(60):
            spread = rng.uniform(0.0, 2.0) / (1.5 / camera.focal * 410.0) ** np.array([2, 4, 1, 1, 6])
            lens = Distortion(*(0.1 * spread * rng.normal(size=5)).tolist())
            folds = fold_radius(camera, lens) is not None
            assert has_inverse(camera, lens) != folds
            slight += not folds
    assert slight > 30
