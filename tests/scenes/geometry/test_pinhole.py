"""The pinhole camera: pixel centres, rays and projections undo each other, windows as sets of pixels."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import R_BODY_OPTICAL, PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se3 import SE3

CAMERA = PinholeCamera.from_hfov(640, 480, math.radians(75.0))

windows = st.builds(
    Window, st.integers(-50, 700), st.integers(-50, 500), st.integers(1, 300), st.integers(1, 300)
)


def pixels_of(window: Window) -> set[tuple[int, int]]:
    return {(x, y) for x in range(window.x, window.x_end) for y in range(window.y, window.y_end)}


def test_the_field_of_view_spans_the_pixel_edges() -> None:
    left, right = CAMERA.bearing([-0.5, 639.5])
    assert left == pytest.approx(math.radians(37.5))
    assert right == pytest.approx(-math.radians(37.5))


def test_the_axis_meets_the_middle_of_the_image() -> None:
    np.testing.assert_allclose(CAMERA.project([0.0, 0.0, 2.0]), [319.5, 239.5])
    assert CAMERA.bearing(CAMERA.cx) == pytest.approx(0.0)


@given(st.floats(-0.5, 639.5), st.floats(-0.5, 479.5), st.floats(0.05, 20.0))
def test_projection_undoes_rays(u: float, v: float, depth: float) -> None:
    np.testing.assert_allclose(CAMERA.project(depth * CAMERA.rays([u, v])), [u, v], atol=1e-8)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.05, 10.0))
def test_projection_is_the_matrix(x: float, y: float, z: float) -> None:
    u = CAMERA.matrix() @ np.array([x, y, z])
    np.testing.assert_allclose(CAMERA.project([x, y, z]), u[:2] / u[2], atol=1e-9)


@given(st.floats(-0.6, 0.6), st.floats(0.1, 5.0))
def test_bearing_is_the_angle_to_the_left(angle: float, distance: float) -> None:
    p_B = distance * np.array([math.cos(angle), math.sin(angle), 0.0])  # body frame: x forward, y left
    column = CAMERA.project(R_BODY_OPTICAL.T @ p_B)[0]
    assert float(CAMERA.bearing(column)) == pytest.approx(angle, abs=1e-9)


def test_optical_frame_looks_along_the_bodys_x() -> None:
    X_UC = optical_pose(SE3.from_xyz_rpy([0.1, 0.0, 0.2], [0.0, 0.0, 0.0]))
    np.testing.assert_allclose(X_UC.act([0.0, 0.0, 1.0]), [1.1, 0.0, 0.2])  # forward
    np.testing.assert_allclose(X_UC.act([1.0, 0.0, 0.0]), [0.1, -1.0, 0.2])  # image right is the body's right
    np.testing.assert_allclose(X_UC.act([0.0, 1.0, 0.0]), [0.1, 0.0, -0.8])  # image down is down


def test_nothing_behind_or_beside_the_camera_is_seen() -> None:
    points = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [5.0, 0.0, 1.0], [0.0, 5.0, 1.0]]
    assert Lens(CAMERA).sees(points).tolist() == [True, False, False, False, False]
    edge = np.array([639.4, 240.0])
    assert Lens(CAMERA).sees(CAMERA.rays(edge))


def test_the_image_ends_half_a_pixel_beyond_the_middles_of_its_outer_pixels() -> None:
    for border, outward in (
        ([-0.5, 100.0], [-1.0, 0.0]),
        ([639.5, 100.0], [1.0, 0.0]),
        ([100.0, -0.5], [0.0, -1.0]),
        ([100.0, 479.5], [0.0, 1.0]),
    ):
        assert CAMERA.contains(np.array(border))
        assert not CAMERA.contains(np.array(border) + 0.125 * np.array(outward))


quarters = st.integers(-80, 2640).map(lambda count: 0.25 * count)  # of pixels, which add up without rounding


@given(quarters, quarters, st.sampled_from([0.0, 0.25, 20.0, 200.0]))
def test_a_pixel_is_inside_by_a_margin_if_all_are_that_are_no_farther_from_it(
    u: float, v: float, margin: float
) -> None:
    around = np.array([[u + i * margin, v + j * margin] for i in (-1, 1) for j in (-1, 1)])
    assert CAMERA.contains(np.array([u, v]), margin) == CAMERA.contains(around).all()


@given(windows, windows)
def test_windows_intersect_as_sets_of_pixels(a: Window, b: Window) -> None:
    common = a.intersection(b)
    x, y = max(a.x, b.x), max(a.y, b.y)
    empty = x >= min(a.x_end, b.x_end) or y >= min(a.y_end, b.y_end)
    assert (common is None) == empty
    if common is not None:
        assert a.contains(common)
        assert b.contains(common)
        assert common == b.intersection(a)
        grown = common.padded(1)
        assert not (a.contains(grown) and b.contains(grown))


def test_intersection_by_counting() -> None:
    a, b = Window(2, 3, 5, 4), Window(5, 1, 9, 4)
    common = a.intersection(b)
    assert common is not None
    assert pixels_of(common) == pixels_of(a) & pixels_of(b)
    assert common.area == len(pixels_of(common))


@given(st.lists(st.tuples(st.floats(0, 600), st.floats(0, 400)), min_size=1, max_size=6), st.floats(0.0, 9.0))
def test_a_window_around_points_holds_them_and_no_more(
    points: list[tuple[float, float]], margin: float
) -> None:
    window = Window.around(points, margin)
    p = np.array(points)
    assert window.x <= p[:, 0].min() - margin < window.x + 1 + 1e-9
    assert window.x_end - 1 >= p[:, 0].max() + margin > window.x_end - 2 - 1e-9
    assert window.y <= p[:, 1].min() - margin
    assert window.y_end - 1 >= p[:, 1].max() + margin
