"""The floor behind the bodies: it lies still, ends at the horizon and does not shimmer."""

from __future__ import annotations

import math

import numpy as np

from msrr_bullet.render.floor import concrete_floor
from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy

CAMERA = PinholeCamera.from_hfov(640, 480, math.radians(75.0))
R_DOWN = np.diag([1.0, -1.0, -1.0])  # image right is world x, image down is world -y


def floor_image(X_WC: SE3, window: Window = CAMERA.frame) -> np.ndarray:
    return concrete_floor().image(CAMERA, X_WC, window)


def test_horizon_is_level_with_the_camera() -> None:
    floor = concrete_floor()
    for pitch in (0.0, 0.1, -0.15):
        image = floor_image(optical_pose(SE3.from_xyz_rpy([0.0, 0.0, 0.155], [0.0, pitch, 0.3])))
        row = CAMERA.cy - CAMERA.focal * math.tan(pitch)
        above, below = image[: math.floor(row) - 1], image[math.ceil(row) + 1 :]
        np.testing.assert_array_equal(above, floor.wall)
        assert abs(below.mean() - floor.levels[-1][0, 0]) < 3.0
    upwards = floor_image(optical_pose(SE3.from_xyz_rpy([0.0, 0.0, 0.155], [0.0, -1.0, 0.0])))
    np.testing.assert_array_equal(upwards, floor.wall)


def test_floor_lies_still_under_a_moving_camera() -> None:
    """Moved by whole pixels the image shifts by as many; turned by a quarter it turns."""
    height = 1.5
    step = height / CAMERA.focal
    a = floor_image(SE3(R_DOWN, np.array([0.3, -0.2, height])))
    b = floor_image(SE3(R_DOWN, np.array([0.3 + 7 * step, -0.2 - 4 * step, height])))
    assert a[20:-20].std() > 1.0
    np.testing.assert_allclose(b[:-4, :-7], a[4:, 7:], atol=0.6)  # OpenCV interpolates in 32nds of a texel
    square = Window(80, 0, 480, 480)
    turn = SE3(rotation_from_rpy(0.0, 0.0, math.pi / 2.0) @ R_DOWN, np.array([0.3, -0.2, height]))
    north = floor_image(SE3(R_DOWN, np.array([0.3, -0.2, height])), square)
    np.testing.assert_allclose(floor_image(turn, square), np.rot90(north, -1), atol=0.6)


def test_floor_does_not_shimmer_towards_the_horizon() -> None:
    """Texture that is finer than a pixel is averaged away, not sampled at random."""
    image = floor_image(optical_pose(SE3.from_xyz_rpy([0.0, 0.0, 0.155], [0.0, 0.0, 0.3])))
    rows = np.arange(243, 480)
    roughness = np.abs(np.diff(image[243:], axis=1)).mean(axis=1)
    far = roughness[rows < 260].mean()
    near = roughness[rows > 380].mean()
    assert far < 0.5
    assert far < near + 0.2


def test_a_camera_under_the_floor_sees_no_floor() -> None:
    image = floor_image(optical_pose(SE3.from_xyz_rpy([0.0, 0.0, -0.1], [0.0, -0.3, 0.0])))
    np.testing.assert_array_equal(image, concrete_floor().wall)
