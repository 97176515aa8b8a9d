"""The errors of refined corners: the geometry of lines through edges, and what noise does to a refinement."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_perception.kernels.edges import SECTIONS, SQUARES, refine_corners
from msrr_perception.kernels.section_errors import DataSheet, variances_of_corners
from msrr_perception.pose.corner_errors import CornerErrors, corners_by_sections
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.specs.sensors import CameraSpec
from tests.perception.conftest import plate, warp


def square(edge_px: float, yaw: float = 0.0) -> np.ndarray:
    c, s = math.cos(yaw), math.sin(yaw)
    corners = 0.5 * edge_px * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    return np.asarray(corners @ np.array([[c, s], [-s, c]]) + 60.0)


def intersected(corners: np.ndarray, offset: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Move each edge outwards by its offset plus the slope times the place (-0.5 .. 0.5) on it; intersect."""
    lines = []
    for e in range(4):
        a, b = corners[e], corners[(e + 1) % 4]
        normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
        lines.append((a + (offset[e] - 0.5 * slope[e]) * normal, b + (offset[e] + 0.5 * slope[e]) * normal))
    out = []
    for e in range(4):
        (a, b), (c, d) = lines[e], lines[e - 1]
        t = np.linalg.solve(np.stack([b - a, c - d], axis=1), c - a)[0]
        out.append(a + t * (b - a))
    return np.array(out)


@pytest.mark.parametrize("yaw", [0.0, 0.4, -2.5])
def test_the_corners_move_as_the_lines_through_the_edges_intersect(yaw: float) -> None:
    corners = square(42.0, yaw)
    rng = np.random.default_rng(3)
    for _ in range(20):
        drawn = 1e-4 * rng.normal(size=(4, 2))
        offset, slope = drawn[:, 0] / math.sqrt(SECTIONS), drawn[:, 1] / math.sqrt(SQUARES)
        moved = intersected(corners, offset, slope) - corners
        np.testing.assert_allclose(corners_by_sections(corners) @ drawn.ravel(), moved.ravel(), atol=1e-8)


@pytest.mark.parametrize("yaw", [0.0, 0.4, -2.5])
def test_each_coordinate_of_a_corner_has_the_variance_that_its_edges_give_it(yaw: float) -> None:
    """Noise of the frame and what lasts are independent, so that their variances add up."""
    errors, moved = CornerErrors(3.0, 0.8), corners_by_sections(square(42.0, yaw))
    by_sections = errors.frame_px(42.0) ** 2 + errors.lasting_px(42.0) ** 2
    np.testing.assert_allclose(np.diag(moved @ moved.T) * by_sections, errors.corner_variance(42.0))


@pytest.mark.parametrize(("edge_px", "noise"), [(30.0, 2.0), (42.0, 2.0), (42.0, 8.0), (66.0, 8.0)])
def test_noise_moves_refined_corners_as_much_as_stated(edge_px: float, noise: float) -> None:
    """60 noisy copies of each of 5 pictures: the deviation of the corners is right to a quarter.

    The 2400 coordinates are 40 per picture that depend on 8 numbers, so that their RMS has a standard
    deviation of 1.6 %; what is left is how the interpolation depends on the direction of the edges.
    """
    rng = np.random.default_rng(4)
    deviations = []
    window = Window(0, 0, 120, 120)
    for i in range(5):
        corners = square(edge_px, 0.3 * i) + rng.uniform(-0.5, 0.5, 2)
        clean = 28.0 + 200.0 / 255.0 * warp(window, [(plate(0), corners)]).astype(float)
        copies = []
        for _ in range(60):
            shaken = np.clip(np.rint(clean + rng.normal(0.0, noise, clean.shape)), 0, 255).astype(np.uint8)
            refined, measured, _ = refine_corners(shaken, corners[None])
            assert measured.all()
            copies.append(refined[0])
        deviations.append(np.std(copies, axis=0))
    errors = CornerErrors.from_spec(CameraSpec(noise_grey=noise))
    per_section = np.sqrt(np.mean(np.square(corners_by_sections(square(edge_px))).sum(axis=1)))
    seen = math.sqrt(float(np.mean(np.square(deviations)))) / per_section
    assert 0.75 < seen / errors.frame_px(edge_px) < 1.25


def test_a_deviation_of_corners_that_is_given_takes_the_place_of_all_others() -> None:
    corners, measured = np.stack([square(30.0).ravel(), square(60.0, 0.4).ravel()]), np.full((2, 4), 5.0)
    found = variances_of_corners(corners, measured, DataSheet(3.0, 0.8, 200.0, 0.3), 2.0)
    np.testing.assert_allclose(found.rest, np.full((2, 4), 2.0 * 0.3**2))
    assert not np.any([found.noise, found.place, found.changing, found.border])


def test_blur_first_smoothes_the_pixels_and_then_reaches_beyond_the_sections() -> None:
    of_blur = [CornerErrors(2.0, blur).lasting_px(42.0) for blur in (0.0, 0.2, 0.5, 0.8, 1.2, 1.6, 2.0)]
    lowest = int(np.argmin(of_blur))
    assert 0 < lowest < 6
    assert (np.diff(of_blur[: lowest + 1]) < 0.0).all()
    assert (np.diff(of_blur[lowest:]) > 0.0).all()
    assert CornerErrors(2.0, 1.0).lasting_px(27.0) > 2.0 * CornerErrors(2.0, 1.0).lasting_px(42.0)


def test_a_camera_without_noise_still_rounds_to_grey_levels() -> None:
    assert CornerErrors.from_spec(CameraSpec(noise_grey=0.0)).noise_grey == pytest.approx(
        math.sqrt(1.0 / 12.0)
    )
    noisy = CornerErrors.from_spec(CameraSpec(noise_grey=3.0, shot_grey=4.0))
    assert noisy.noise_grey == pytest.approx(math.sqrt(9.0 + 8.0 + 1.0 / 12.0))
