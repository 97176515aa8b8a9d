"""The motion of ideal unicycles behind the nested limits of eq. 3, any number at once."""

from __future__ import annotations

import numpy as np

from msrr_control.kinematics.elementwise import cos, join, number, sin, sinc, split
from msrr_scenes.arrays import Array
from msrr_scenes.specs.vehicle import LimitsSpec


def drive(twist: Array, command: Array, limits: LimitsSpec, dt: float) -> tuple[Array, Array]:
    r"""Follow a command that is held for ``dt`` [s] behind the nested limits, in closed form.

    On each axis the distance to the command shrinks at the rate limit a while it is larger than a / kappa,
    then as exp(-kappa t). An explicit step of 20 ms would be ahead of this by a step: on a ramp it lags
    46.7 ms where 1 / kappa is 66.7 ms.

    Source: Zheng et al., eq. 3.

    Args:
        twist: Speeds (v, w) at the beginning, shape (..., 2) [m/s, rad/s].
        command: Commanded speeds, same shape.
        limits: What the drive can do.
        dt: Step > 0.

    Returns:
        The speeds at the end of the step, and their means over it, by which a unit moves: with these
        :func:`advance_pose` is right to 2 micrometres at 20 ms and the limits of the shipped unit.
    """
    after, mean = np.empty(twist.shape), np.empty(twist.shape)
    kappa = limits.kappa_per_s
    for axis, most, rate in (
        (0, limits.v_max_mps, limits.a_max_mps2),
        (1, limits.w_max_radps, limits.dw_max_radps2),
    ):
        goal = np.clip(command[..., axis], -most, most)
        away = twist[..., axis] - goal
        distance = np.abs(away)
        ramp = np.clip((distance - rate / kappa) / rate, 0.0, dt)  # time at the rate limit
        left = distance - rate * ramp
        decay = np.exp(-kappa * (dt - ramp))
        covered = ramp * (distance - 0.5 * rate * ramp) + left * (1.0 - decay) / kappa
        after[..., axis] = goal + np.copysign(left * decay, away)
        mean[..., axis] = goal + np.copysign(covered / dt, away)
    return after, mean


def advance_pose(pose: Array, length: Array, turn: Array) -> Array:
    """Move poses along circular arcs.

    Args:
        pose: Poses (x, y, yaw), shape (..., 3) [m, m, rad].
        length: Lengths of the arcs, negative backwards, shape (...) [m].
        turn: Angles of the arcs, counter-clockwise positive, same shape [rad].
    """
    x, y, yaw = split(pose)
    turn, length = number(turn), number(length)
    half = 0.5 * turn
    chord, direction = length * sinc(half), yaw + half
    return join(x + chord * cos(direction), y + chord * sin(direction), yaw + turn)
