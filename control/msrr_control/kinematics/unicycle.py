"""Motion of ideal unicycles, any number at once, and what slip and odometry make of it."""

from __future__ import annotations

import numpy as np

from msrr_control.kinematics.controlled_point import rotate
from msrr_scenes.arrays import Array


def advance_pose(pose: Array, twist: Array, dt: float) -> Array:
    """Move poses, shape (..., 3), by constant twists, shape (..., 2), for ``dt`` [s], along the chords."""
    middle = pose[..., 2] + 0.5 * dt * twist[..., 1]
    step = dt * twist[..., 0] * np.sinc(0.5 * dt * twist[..., 1] / np.pi)
    change = [step * np.cos(middle), step * np.sin(middle), dt * twist[..., 1]]
    return pose + np.stack(change, axis=-1)


def slipping_twist(twist: Array, grips: Array, track: float) -> Array:
    """Return the true speeds of a unit whose wheels slip.

    Args:
        twist: (v, w) as the encoders measure them, shape (..., 2) [m/s, rad/s].
        grips: Share of its encoder's path that the left and the right wheel cover, shape (..., 2).
        track: Distance between the wheels [m].

    Returns:
        (v, w), shape (..., 2).
    """
    half = 0.5 * track * twist[..., 1]
    left, right = grips[..., 0] * (twist[..., 0] - half), grips[..., 1] * (twist[..., 0] + half)
    return np.stack([0.5 * (left + right), (right - left) / track], axis=-1)


def apply_motion(pose: Array, before: Array, after: Array) -> Array:
    """Move ``pose`` by the motion from the odometry pose ``before`` to ``after``, each of shape (..., 3)."""
    moved = pose + (after - before)
    moved[..., :2] = pose[..., :2] + rotate(after[..., :2] - before[..., :2], pose[..., 2] - before[..., 2])
    return moved
