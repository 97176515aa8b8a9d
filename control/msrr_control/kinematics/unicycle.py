"""The motion of ideal unicycles behind the nested limits of eq. 3, any number at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from msrr_control.kinematics.elementwise import (
    Number,
    copysign,
    cos,
    exp,
    join,
    limit,
    number,
    sin,
    sinc,
    split,
)
from msrr_scenes.arrays import Array
from msrr_scenes.specs.vehicle import LimitsSpec


def drive(twist: Array, command: Array, limits: LimitsSpec, dt: float) -> tuple[Array, Array]:
    r"""Follow a command that is held for ``dt`` [s] behind the nested limits, in closed form.

    On each axis the distance to the command shrinks at the rate limit a while it is larger than a / kappa,
    then as exp(-kappa t). An explicit step of 20 ms would be ahead of this by half a step: at the end of
    each step it is 46.7 ms behind a command that ramps, and this 57.2 ms.

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
    (v, mean_v), (w, mean_w) = drive_components(split(twist), split(command), limits, dt)
    return join(v, w), join(mean_v, mean_w)


def drive_components(
    twist: Sequence[Any], command: Sequence[Any], limits: LimitsSpec, dt: float
) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Return what :func:`drive` does for v and for w: speed at the end, and mean; floats or of any shape."""
    (v, w), (v_sent, w_sent), kappa = twist, command, limits.kappa_per_s
    return (
        _follow(v, v_sent, limits.v_max_mps, limits.a_max_mps2, kappa, dt),
        _follow(w, w_sent, limits.w_max_radps, limits.dw_max_radps2, kappa, dt),
    )


def _follow(
    speed: Number, command: Number, most: float, rate: float, kappa: float, dt: float
) -> tuple[Number, Number]:
    """Return the speed at the end of a step, and its mean, on one axis."""
    goal = limit(command, -most, most)
    away = speed - goal
    distance = abs(away)
    ramp = limit((distance - rate / kappa) / rate, 0.0, dt)  # time at the rate limit
    left = distance - rate * ramp
    decay = exp(-kappa * (dt - ramp))
    covered = ramp * (distance - 0.5 * rate * ramp) + left * (1.0 - decay) / kappa
    return goal + copysign(left * decay, away), goal + copysign(covered / dt, away)


def advance_pose(pose: Array, length: Array, turn: Array) -> Array:
    """Move poses along circular arcs.

    Args:
        pose: Poses (x, y, yaw), shape (..., 3) [m, m, rad].
        length: Lengths of the arcs, negative backwards, shape (...) [m].
        turn: Angles of the arcs, counter-clockwise positive, same shape [rad].
    """
    return join(*advance_components(split(pose), number(length), number(turn)))


def advance_components(pose: Sequence[Any], length: Any, turn: Any) -> tuple[Any, Any, Any]:
    """Return what :func:`advance_pose` does for x, y and yaw, which are all floats or all arrays (...)."""
    (x, y, yaw), half = pose, 0.5 * turn
    chord, direction = length * sinc(half), yaw + half
    return x + chord * cos(direction), y + chord * sin(direction), yaw + turn
