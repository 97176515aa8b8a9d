"""What tests of photographs share: a picture of tags."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.messages import Pixels
from tests.perception.conftest import plate, warp

SIZE = Window(0, 0, 240, 180)
SQUARES = {
    3: np.array([[30.0, 100.0], [95.0, 104.0], [92.0, 38.0], [31.0, 40.0]]),
    7: np.array([[140.0, 130.0], [200.0, 125.0], [205.0, 66.0], [142.0, 70.0]]),
}


@pytest.fixture(scope="session")
def two_tags() -> Pixels:
    """A picture of the tags 3 and 7, whose corners are :data:`SQUARES`."""
    return warp(SIZE, [(plate(tag), corners) for tag, corners in SQUARES.items()])


@pytest.fixture(scope="session")
def squares() -> dict[int, np.ndarray]:
    return SQUARES
