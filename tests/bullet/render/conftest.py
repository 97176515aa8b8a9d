"""Boxes to put into a PyBullet client, a floor without texture, and the centroid of an outline."""

from __future__ import annotations

import numpy as np
import pybullet
from numpy.typing import NDArray

from msrr_bullet.render.floor import Floor
from msrr_scenes.geometry.se3 import SE3


def place(body: int, X_WB: SE3) -> None:
    """Move the base of a body to a pose in W."""
    pybullet.resetBasePositionAndOrientation(body, X_WB.p.tolist(), X_WB.quaternion_xyzw().tolist())


def add_box(size: list[float], X_WB: SE3, grey: float = 1.0) -> int:
    """Add a massless box with full edges [m] at a pose in W; return its body id."""
    shape = pybullet.createVisualShape(
        pybullet.GEOM_BOX, halfExtents=[0.5 * a for a in size], rgbaColor=[grey, grey, grey, 1.0]
    )
    body: int = pybullet.createMultiBody(0.0, baseVisualShapeIndex=shape)
    place(body, X_WB)
    return body


def plain_floor(grey: float) -> Floor:
    """Return a floor and a wall of one grey level."""
    return Floor(lambda: np.full((1, 1), grey, dtype=np.float32), 1.0, grey)


def centroid(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the centroid of a polygon with corners of shape (N, 2)."""
    origin = outline[0]
    a, b = outline - origin, np.roll(outline, -1, axis=0) - origin
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    middle: NDArray[np.float64] = origin + ((a + b) * cross[:, np.newaxis]).sum(axis=0) / (3.0 * cross.sum())
    return middle
