from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.detection.detector import PupilDetector
from msrr_perception.kernels.edges import refine_corners
from msrr_scenes.geometry.pinhole import Window
from tests.perception.conftest import plate, warp

WINDOW = Window(0, 0, 120, 120)
OUTWARD = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])


def _square(rng: np.random.Generator, size: float) -> np.ndarray:
    shape = 0.5 * size * OUTWARD * [rng.uniform(0.75, 1.0), 1.0] + rng.normal(0.0, 0.02 * size, (4, 2))
    return shape + 60.0 + rng.uniform(-2.0, 2.0, 2)


@pytest.mark.parametrize(("size", "rms_px"), [(28.0, 0.08), (48.0, 0.05), (80.0, 0.03)])
def test_corners_are_found_from_a_rough_guess(size: float, rms_px: float) -> None:
    """20 squares, guessed up to 0.3 px off, noise 2 grey levels."""
    rng, errors = np.random.default_rng(0), []
    for i in range(20):
        square = _square(rng, size)
        image = warp(WINDOW, [(plate(i), square)]) + rng.normal(0.0, 2.0, (120, 120))
        guess = square + rng.uniform(-0.3, 0.3, (4, 2))
        (found,) = refine_corners(np.clip(image, 0, 255).astype(np.uint8), guess[None]).corners
        errors.append(found - square)
    assert np.sqrt(np.mean(np.square(errors))) < rms_px
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 0.03  # no shift
    assert abs((np.array(errors) * OUTWARD).mean()) < 0.05  # no growth


def test_it_is_four_times_as_exact_as_the_library() -> None:
    rng = np.random.default_rng(1)
    errors: dict[bool, list[np.ndarray]] = {True: [], False: []}
    for i in range(30):
        square = _square(rng, 40.0)
        image = warp(WINDOW, [(plate(i), square)])
        for refine, found in errors.items():
            (tag,) = PupilDetector(refine=refine).detect(image, WINDOW)
            found.append(tag.corners - square)
    raw, fine = (np.sqrt(np.mean(np.square(errors[refine]))) for refine in (False, True))
    assert fine < 0.25 * raw


def test_who_guessed_hardly_matters() -> None:
    """50 guesses, scattered by 0.3 px, of 10 squares: what they end at scatters by a 50th of that."""
    rng, spread = np.random.default_rng(3), []
    for i in range(10):
        square = _square(rng, 40.0)
        image = warp(WINDOW, [(plate(i), square)])
        found = refine_corners(image, square + rng.uniform(-0.5, 0.5, (5, 4, 2))).corners
        spread.append(found - found.mean(axis=0))
    assert np.sqrt(np.mean(np.square(spread))) < 0.006


def test_what_is_no_edge_keeps_its_corners() -> None:
    """No contrast, half outside the image, or far from any edge: nothing is invented, and it is said."""
    square = _square(np.random.default_rng(3), 50.0)
    image = warp(WINDOW, [(plate(0), square)])
    guesses = np.stack([square + 0.2, square + 12.0, square - [50.0, 0.0]])
    found, measured, _ = refine_corners(image, guesses)
    assert measured.tolist() == [True, False, False]
    np.testing.assert_allclose(found[0], square, atol=0.15)
    np.testing.assert_array_equal(found[1:], guesses[1:])
    flat = np.full_like(image, 90)
    found, measured, sigma_px = refine_corners(flat, square[None])
    assert not measured.any()
    assert np.isnan(sigma_px).all()
    np.testing.assert_array_equal(found[0], square)


def test_a_corner_is_not_led_away_step_by_step() -> None:
    """A guess 2.1 px off: each fit moves the corners by less than is allowed, all together by more."""
    square = _square(np.random.default_rng(4), 28.0)
    image = warp(WINDOW, [(plate(0), square)])
    guess = square + 1.5
    found, measured, _ = refine_corners(image, guess[None])
    assert not measured[0]
    np.testing.assert_array_equal(found[0], guess)


@pytest.mark.parametrize("turn", [0.0, 0.7, 1.6, 2.5])
def test_light_that_falls_off_along_the_tag_turns_no_edge(turn: float) -> None:
    """A tag of 80 px, lit by 30 % less at one side than at the other: corners are those in even light.

    What is left is the change of the light across an edge, over the length of a cross section.
    """
    y, x = np.mgrid[0:120, 0:120] - 60.0
    light = 1.0 - 0.3 * (0.5 + (np.cos(turn) * x + np.sin(turn) * y) / 80.0).clip(0.0, 1.0)
    rng, errors = np.random.default_rng(5), []
    for i in range(6):
        square = _square(rng, 80.0)
        image = warp(WINDOW, [(plate(i), square)])
        shaded = np.round(image * light).astype(np.uint8)
        (even,) = refine_corners(image, square[None]).corners
        (found,), (measured,), _ = refine_corners(shaded, square[None])
        assert measured
        errors.append(found - even)
    assert np.abs(errors).max() < 0.06


@pytest.mark.parametrize("blur_px", [0.0, 1.2])
def test_a_picture_that_is_turned_or_mirrored_shows_the_same(blur_px: float) -> None:
    """Tags of 24 px anywhere in a picture, with sections that reach beyond its borders or do not."""
    rng, window, measured = np.random.default_rng(8), Window(0, 0, 60, 50), []
    for i in range(24):
        square = _square(rng, 24.0) - 60.0 + rng.uniform([9.0, 9.0], [50.0, 40.0])
        picture = warp(window, [(plate(i), square)])
        found = refine_corners(picture, square[None], blur_px=blur_px)
        measured.append(bool(found.measured[0]))
        expected = found.corners[0]
        for turn in range(8):
            width = picture.shape[1]
            if turn == 4:
                picture = picture[:, ::-1]
                square, expected = ([width - 1.0, 0.0] + [-1.0, 1.0] * p for p in (square, expected))
            else:
                picture = np.rot90(picture)
                square, expected = ([0.0, width - 1.0] + [1.0, -1.0] * p[:, ::-1] for p in (square, expected))
            turned = refine_corners(picture, square[None], blur_px=blur_px)
            np.testing.assert_allclose(turned.corners[0], expected, atol=1e-6)
            np.testing.assert_allclose(turned.sigma_px, found.sigma_px, rtol=1e-6)
    assert 5 < sum(measured) < 20
