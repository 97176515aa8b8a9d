"""Ideal unicycles behind the nested limits of eq. 3, any number at once."""

from __future__ import annotations

import numpy as np

from msrr_control.kinematics.drive_limits import nested_limit
from msrr_control.kinematics.offset_point import rotate
from msrr_scenes.arrays import Array
from msrr_scenes.specs.vehicle import LimitsSpec


def drive(twist: Array, command: Array, limits: LimitsSpec, dt: float) -> Array:
    """Return the speeds (v, w), shape (..., 2), one step of ``dt`` [s] after a command.

    Source: Zheng et al., eq. 3.
    """
    passed = np.empty(twist.shape)
    for axis, most, rate in (
        (0, limits.v_max_mps, limits.a_max_mps2),
        (1, limits.w_max_radps, limits.dw_max_radps2),
    ):
        passed[..., axis] = nested_limit(
            twist[..., axis], command[..., axis], most, rate, limits.kappa_per_s, dt
        )
    return passed


def roll(pose: Array, twist: Array, dt: float) -> Array:
    """Move poses, shape (..., 3), by a constant twist for ``dt`` [s]: along the chord of the arc."""
    middle = pose[..., 2] + 0.5 * dt * twist[..., 1]
    step = dt * twist[..., 0] * np.sinc(0.5 * dt * twist[..., 1] / np.pi)
    change = [step * np.cos(middle), step * np.sin(middle), dt * twist[..., 1]]
    return pose + np.stack(change, axis=-1)


def slipped(twist: Array, grips: Array, track: float) -> Array:
    """Return the speeds of a unit whose wheels slip, from the (v, w) that its encoders tell.

    Args:
        twist: Shape (..., 2) [m/s, rad/s].
        grips: What the left and the right wheel cover of their encoder's path, shape (..., 2).
        track: Distance between the wheels [m].
    """
    half = 0.5 * track * twist[..., 1]
    left, right = grips[..., 0] * (twist[..., 0] - half), grips[..., 1] * (twist[..., 0] + half)
    return np.stack([0.5 * (left + right), (right - left) / track], axis=-1)


def moved_on(seen: Array, was: Array, now: Array) -> Array:
    """Apply the motion from pose ``was`` to pose ``now`` to the pose ``seen``, each of shape (..., 3)."""
    moved = seen + (now - was)
    moved[..., :2] = seen[..., :2] + rotate(now[..., :2] - was[..., :2], seen[..., 2] - was[..., 2])
    return moved
