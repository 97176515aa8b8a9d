"""The motion of ideal unicycles, any number at once."""

from __future__ import annotations

import numpy as np

from msrr_scenes.arrays import Array


def advance_pose(pose: Array, length: Array, turn: Array) -> Array:
    """Move poses along circular arcs.

    Args:
        pose: Poses (x, y, yaw), shape (..., 3) [m, m, rad].
        length: Lengths of the arcs, negative backwards, shape (...) [m].
        turn: Angles of the arcs, counter-clockwise positive, same shape [rad].
    """
    half = 0.5 * turn
    chord = length * np.sinc(half / np.pi)
    direction = pose[..., 2] + half
    return pose + np.stack([chord * np.cos(direction), chord * np.sin(direction), turn], axis=-1)
