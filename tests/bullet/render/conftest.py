"""Boxes to put into a PyBullet client, and a floor without texture."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pybullet
import pytest

from msrr_bullet.render.floor import Floor
from msrr_scenes.geometry.se3 import SE3


@pytest.fixture(scope="session")
def place() -> Callable[[int, SE3], None]:
    """Move the base of a body to a pose in W."""

    def move(body: int, X_WB: SE3) -> None:
        pybullet.resetBasePositionAndOrientation(body, X_WB.p.tolist(), X_WB.quaternion_xyzw().tolist())

    return move


@pytest.fixture(scope="session")
def add_box(place: Callable[[int, SE3], None]) -> Callable[..., int]:
    """Add a massless box with full edges [m] at a pose in W; return its body id."""

    def add(size: list[float], X_WB: SE3, grey: float = 1.0) -> int:
        shape = pybullet.createVisualShape(
            pybullet.GEOM_BOX, halfExtents=[0.5 * a for a in size], rgbaColor=[grey, grey, grey, 1.0]
        )
        body: int = pybullet.createMultiBody(0.0, baseVisualShapeIndex=shape)
        place(body, X_WB)
        return body

    return add


@pytest.fixture(scope="session")
def plain_floor() -> Callable[[float], Floor]:
    """Return a floor and a wall of one grey level."""
    return lambda grey: Floor(lambda: np.full((1, 1), grey, dtype=np.float32), 1.0, grey)
