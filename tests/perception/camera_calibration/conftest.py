"""Boards as a camera with a known lens shows them: every pixel is the mean of nine rays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial

import cv2
import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from msrr_perception.camera_calibration.boards import Board, CharucoBoard, Chessboard, TagGrid
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Pixels

#: Rays of a pixel along each axis, and distance of the pixels whose rays are computed [px].
SAMPLES, SPACING = 3, 8.0

BLUR_PX, NOISE_GREY, BLACK, WHITE = 0.6, 2.0, 40.0, 210.0


@lru_cache(maxsize=4)
def rays(lens: Lens) -> Array:
    """Return points of the plane z = 1 that all samples show, shape (height * S, width * S, 2)."""
    camera = lens.camera
    nodes = [np.arange(-SPACING, size + 2.0 * SPACING, SPACING) for size in (camera.height, camera.width)]
    v, u = np.meshgrid(*nodes, indexing="ij")
    at_nodes = camera.rays(lens.undistorted(np.stack([u, v], axis=-1).reshape(-1, 2)))
    places = [(np.arange(size * SAMPLES) + 0.5) / SAMPLES - 0.5 for size in (camera.height, camera.width)]
    splines = (RectBivariateSpline(*nodes, at_nodes[:, i].reshape(u.shape)) for i in (0, 1))
    return np.stack([spline(*places) for spline in splines], axis=-1)


@dataclass
class BoardCamera:
    """A camera that photographs flat prints on grey ground."""

    lens: Lens
    seed: int = 1
    _rng: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)

    def photograph(self, print_: Pixels, pixel: float, X_CB: SE3) -> Pixels:
        """Return a picture of a print.

        Args:
            print_: The print, one grey level for each of its pixels.
            pixel: Edge of a pixel of the print [m]; the upper left corner of the first is the origin of B.
            X_CB: Pose of the print in the camera.
        """
        to_print = np.linalg.inv(np.column_stack([X_CB.R[:, 0], X_CB.R[:, 1], X_CB.p]))
        x, y = np.moveaxis(rays(self.lens), -1, 0)
        a, b, w = (row[0] * x + row[1] * y + row[2] for row in to_print)
        column, row = np.floor(a / w / pixel), np.floor(b / w / pixel)
        height, width = print_.shape
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        levels = print_[np.where(inside, row, 0).astype(int), np.where(inside, column, 0).astype(int)]
        light = np.where(inside, BLACK + (WHITE - BLACK) / 255.0 * levels, 0.5 * (BLACK + WHITE))
        camera = self.lens.camera
        means = light.reshape(camera.height, SAMPLES, camera.width, SAMPLES).mean(axis=(1, 3))
        noise = self._rng.normal(0.0, NOISE_GREY, means.shape)
        blurred = cv2.GaussianBlur(means, (0, 0), BLUR_PX) + noise
        return np.asarray(np.clip(np.rint(blurred), 0.0, 255.0), dtype=np.uint8)

    def poses(self, size: tuple[float, float], count: int) -> list[SE3]:
        """Return poses of a print, tilted to all sides by up to 35 degrees, near all borders of the picture.

        Args:
            size: Width and height of the print [m].
            count: Number of poses.
        """
        frame, found = self.lens.camera, list[SE3]()
        outline_B = np.array([[x, y, 0.0] for x in (0.0, size[0]) for y in (0.0, size[1])])
        while len(found) < count:
            direction = 2.0 * np.pi * (len(found) + self._rng.uniform(0.0, 0.5)) / count
            lean = np.radians(self._rng.uniform(15.0, 35.0)) * np.array(
                [np.cos(direction), np.sin(direction)]
            )
            turn = cv2.Rodrigues(np.array([0.0, 0.0, self._rng.uniform(-0.5, 0.5)]))[0]
            R = cv2.Rodrigues(np.array([*lean, 0.0]))[0] @ turn
            depth = frame.focal * size[0] / frame.width * self._rng.uniform(1.4, 1.9)
            aside = self._rng.uniform(-0.35, 0.35, 2) * [frame.width, frame.height] / frame.focal
            X_CB = SE3(R, depth * np.array([*aside, 1.0]) - R @ np.array([0.5 * size[0], 0.5 * size[1], 0.0]))
            shown = self.lens.distorted(frame.project(X_CB.act(outline_B)))
            if frame.contains(shown, 4.0).all():
                found.append(X_CB)
        return found


@dataclass(frozen=True)
class Print:
    """A board as it is printed, and as it is described to the finder.

    Attributes:
        pixels: Grey levels of the print.
        pixel: Edge of one of its pixels [m].
        board: The board.
        points: Every point that the board may have, in the frame of the print, shape (N, 3) [m].
    """

    pixels: Pixels
    pixel: float
    board: Board
    points: Array

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [m]."""
        return self.pixel * self.pixels.shape[1], self.pixel * self.pixels.shape[0]


SQUARE, MARGIN_PX = 0.03, 20


def chessboard() -> Print:
    """7 x 5 inner corners, with a white border of one square."""
    cells = np.pad(np.indices((6, 8)).sum(axis=0) % 2, 1, constant_values=1)
    x, y = np.meshgrid(SQUARE * np.arange(2, 9), SQUARE * np.arange(2, 7))
    return Print(
        np.kron(255 * cells, np.ones((4, 4))).astype(np.uint8),
        SQUARE / 4,
        Chessboard(7, 5, SQUARE),
        np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3),
    )


def charuco(*, old: bool = False) -> Print:
    """8 x 6 squares, printed by OpenCV; ``old`` for the pattern of its versions before 4.6."""
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard((8, 6), SQUARE, 0.022, markers)
    board.setLegacyPattern(old)
    pixels = board.generateImage((8 * 60 + 2 * MARGIN_PX, 6 * 60 + 2 * MARGIN_PX), marginSize=MARGIN_PX)
    pixel = SQUARE / 60
    points = np.asarray(board.getChessboardCorners(), dtype=np.float64) + pixel * MARGIN_PX * np.array(
        [1, 1, 0]
    )
    return Print(pixels, pixel, CharucoBoard(8, 6, SQUARE, 0.022, "DICT_4X4_50"), points)


def tag_grid(*, upwards: bool = False) -> Print:
    """4 x 3 tags of 40 mm every 50 mm, by OpenCV; ``upwards`` for ids that begin in the lowest row."""
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    tags = [
        [cv2.aruco.generateImageMarker(markers, 4 * row + column, 80) for column in range(4)]
        for row in range(3)
    ]
    gapped = [np.hstack([np.pad(tag, 10, constant_values=255) for tag in row]) for row in tags]
    pixels = np.pad(np.vstack(gapped[::-1] if upwards else gapped), 10, constant_values=255)
    pixel = 0.05 / 100
    x, y = np.meshgrid(*(np.ravel([[0.01 + 0.05 * i, 0.05 + 0.05 * i] for i in range(n)]) for n in (4, 3)))
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return Print(np.asarray(pixels, dtype=np.uint8), pixel, TagGrid(4, 3, 0.05, 0.04, "tag36h11"), points)


#: Prints by the names that tests give them.
PRINTS: dict[str, Callable[[], Print]] = {
    "chessboard": chessboard,
    "charuco": charuco,
    "old charuco": partial(charuco, old=True),
    "tags": tag_grid,
    "tags upwards": partial(tag_grid, upwards=True),
}


@pytest.fixture
def camera() -> BoardCamera:
    """A camera whose lens distorts by some pixels at the borders."""
    return BoardCamera(Lens(PinholeCamera(400, 300, 330.0, (3.0, -2.0)), Distortion(k1=-0.1, k2=0.02)))


@pytest.fixture(scope="session")
def printed() -> Callable[[str], Print]:
    """Return a print by its name."""
    return lambda name: PRINTS[name]()
