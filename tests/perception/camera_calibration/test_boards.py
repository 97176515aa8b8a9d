"""Boards are found in rendered pictures, to a few hundredths of a pixel, whatever way they were printed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from msrr_perception.camera_calibration.boards import BoardError, CharucoBoard, Chessboard, TagGrid
from msrr_scenes.errors import UnknownNameError

#: What the conftest of this folder makes: a camera, and prints by their names.
Camera, Printed = Any, Callable[[str], Any]


@pytest.mark.parametrize(
    ("name", "share", "rms_px"),
    [
        pytest.param("chessboard", 1.0, 0.12, marks=pytest.mark.nightly),
        ("charuco", 0.6, 0.3),
        ("tags", 1.0, 0.2),
        pytest.param("old charuco", 0.6, 0.3, marks=pytest.mark.nightly),
        pytest.param("tags upwards", 1.0, 0.2, marks=pytest.mark.nightly),
    ],
)
def test_points_are_found_where_they_are(
    camera: Camera, printed: Printed, name: str, share: float, rms_px: float
) -> None:
    """Points and their places on the board belong together: one perspective maps one to the other."""
    board = printed(name)
    (X_CB,) = camera.poses(board.size, 1)
    found = board.board.find(camera.photograph(board.pixels, board.pixel, X_CB))
    assert found is not None
    assert len(found.corners) >= share * len(board.points)
    shown = camera.lens.distorted(camera.lens.camera.project(X_CB.act(board.points)))
    distances = np.linalg.norm(shown[:, np.newaxis] - found.corners, axis=2)
    nearest = distances.argmin(axis=0)
    assert len(set(nearest.tolist())) == len(nearest)
    assert np.sqrt((distances.min(axis=0) ** 2).mean()) < rms_px
    # Up to a turn of the board, which may have no top, distances between points are those of the print.
    told = np.linalg.norm(found.points_B - found.points_B[0], axis=1)
    np.testing.assert_allclose(told, np.linalg.norm(board.points[nearest] - board.points[nearest[0]], axis=1))


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Chessboard(2, 5, 0.03), "3 x 3 inner corners or more, found 2 x 5"),
        (lambda: CharucoBoard(8, 6, 0.03, 0.03, "DICT_4X4_50"), "smaller than its square"),
        (lambda: CharucoBoard(8, 6, 0.03, 0.02, "4X4_51"), "did you mean '4X4_50'"),
        (lambda: CharucoBoard(20, 20, 0.03, 0.02, "4X4_50"), "at most 50 markers"),
        (lambda: TagGrid(1, 1, 0.05, 0.04, "tag36h11"), "2 tags or more"),
        (lambda: TagGrid(4, 3, 0.05, 0.05, "tag36h11"), "each smaller than their distance"),
    ],
)
def test_boards_that_cannot_be_are_refused(build: Callable[[], object], message: str) -> None:
    with pytest.raises((BoardError, UnknownNameError), match=message):
        build()


def test_a_grid_of_tags_is_not_told_as_a_chessboard(printed: Callable[[str], Any]) -> None:
    """A search for chessboards takes the squares of the tags for theirs."""
    assert Chessboard(7, 5, 0.03).hint(printed("tags").pixels) == "12 AprilTags and no chessboard"
