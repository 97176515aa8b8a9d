"""The controlled point ahead of (or behind) the axle, which the drive can move in any direction."""

from __future__ import annotations

from msrr_control.kinematics.elementwise import Number, cos, join, limit, number, sin, split
from msrr_scenes.arrays import Array

#: Position errors beyond this [m] are cut: farther than any arena, and long before eq. 27's exponential
#: overflows.
_MAX_ERROR_M = 100.0


def rotate_components(x: Number, y: Number, angle: Number) -> tuple[Number, Number]:
    """Return the components of the vectors (x, y) rotated by ``angle`` [rad], counter-clockwise positive."""
    c, s = cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


def rotate(vector: Array, angle: Array) -> Array:
    """Rotate vectors, shape (..., 2), by ``angle`` [rad], shape (...), counter-clockwise positive."""
    x, y = split(vector)
    return join(*rotate_components(x, y, number(angle)))


def offset_point(pose: Array, offset: float) -> Array:
    """Return the controlled point p_l.

    Source: Zheng et al., eq. 1 (the output).

    Args:
        pose: Axle pose (x, y, yaw) in some frame, shape (..., 3) [m, m, rad].
        offset: l, positive ahead of the axle, negative behind it [m].

    Returns:
        The point in the same frame, shape (..., 2) [m].
    """
    x, y, yaw = split(pose)
    return join(x + offset * cos(yaw), y + offset * sin(yaw))


def point_velocity(twist: Array, yaw: Array, offset: float) -> Array:
    r"""Return the velocity of the controlled point.

    .. math:: \dot x_l = v\cos\theta - l w\sin\theta,\quad \dot y_l = v\sin\theta + l w\cos\theta

    Source: Zheng et al., eqs. 1 and 2.

    Args:
        twist: (v, w), shape (..., 2) [m/s, rad/s].
        yaw: Heading, shape (...) [rad].
        offset: l [m].

    Returns:
        Velocity in the frame that ``yaw`` is measured in, shape (..., 2) [m/s].
    """
    v, w = split(twist)
    return join(*rotate_components(v, offset * w, number(yaw)))


def twist_for(velocity: Array, yaw: Array, offset: float) -> Array:
    r"""Return the twist that gives the controlled point a velocity; the inverse of :func:`point_velocity`.

    .. math:: v = u_x\cos\theta + u_y\sin\theta,\quad w = (-u_x\sin\theta + u_y\cos\theta)/l

    Args:
        velocity: Velocity of the point, shape (..., 2) [m/s].
        yaw: Heading, shape (...) [rad].
        offset: l, not zero [m].

    Returns:
        (v, w), shape (..., 2) [m/s, rad/s].
    """
    x, y = split(velocity)
    v, across = rotate_components(x, y, -number(yaw))
    return join(v, across / offset)


def position_error(position: Number, goal: Number) -> Number:
    """Return the error of a position against its goal, any shape [m], cut beyond the size of any arena."""
    return limit(position - goal, -_MAX_ERROR_M, _MAX_ERROR_M)
