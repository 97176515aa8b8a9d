"""Clutter: boxes and tags that pierce each other, in front of a camera held anyhow.

What renderers are compared on. Everything stands above the floor, where all renderers agree on what is seen.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pybullet

from msrr_bullet.simulation.tag_plates import load_tag_plate
from msrr_scenes.geometry.se3 import SE3

#: Middle of the clutter in W [m].
_MIDDLE = np.array([0.0, 0.0, 0.5])


def add_clutter(client: int, rng: np.random.Generator, folder: Path, boxes: int = 8, tags: int = 4) -> None:
    """Load massless boxes and tag plates at random poses within 0.3 m of one place.

    Args:
        client: PyBullet client.
        rng: Source of the poses, sizes and shades.
        folder: Existing folder for the plates' files; has to outlive their loading.
        boxes: Number of boxes, 4 to 30 cm long.
        tags: Number of tags, 5 to 15 cm wide.
    """
    for _ in range(boxes):
        grey = rng.uniform(0.1, 0.95)
        shape = pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=rng.uniform(0.02, 0.15, 3).tolist(),
            rgbaColor=[grey, grey, grey, 1.0],
            physicsClientId=client,
        )
        quaternion = rng.standard_normal(4)
        pybullet.createMultiBody(
            baseMass=0.0,
            baseVisualShapeIndex=shape,
            basePosition=(_MIDDLE + rng.uniform([-0.3, -0.3, -0.2], [0.3, 0.3, 0.2])).tolist(),
            baseOrientation=(quaternion / np.linalg.norm(quaternion)).tolist(),
            physicsClientId=client,
        )
    for _ in range(tags):
        X_WT = SE3.from_xyz_rpy(_MIDDLE + rng.uniform(-0.25, 0.25, 3), rng.uniform(-math.pi, math.pi, 3))
        load_tag_plate(client, folder, int(rng.integers(0, 587)), float(rng.uniform(0.05, 0.15)), X_WT)


def random_view(rng: np.random.Generator) -> SE3:
    """Return ``X_WC`` of a camera 0.1 to 1 m from the clutter's middle, towards it, with any roll.

    The near ones stand among the boxes, some of which cross the camera's near plane.
    """
    azimuth, height = rng.uniform(-math.pi, math.pi), rng.uniform(0.1, 1.2)
    away = np.array(
        [math.cos(azimuth) * math.cos(height), math.sin(azimuth) * math.cos(height), math.sin(height)]
    )
    p_WC = _MIDDLE + rng.uniform(0.1, 1.0) * away
    forward = _MIDDLE + rng.uniform(-0.1, 0.1, 3) - p_WC
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    roll = rng.uniform(-math.pi, math.pi)
    c, s = math.cos(roll), math.sin(roll)
    return SE3(np.stack([c * right + s * down, -s * right + c * down, forward], axis=1), p_WC)
