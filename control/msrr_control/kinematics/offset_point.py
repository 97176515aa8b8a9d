"""The controlled point ahead of (or behind) the axle, through which a differential drive moves freely."""

from __future__ import annotations

from msrr_control.kinematics.elementwise import Number, cos, join, number, sin, split
from msrr_scenes.arrays import Array


def rotated(x: Number, y: Number, angle: Number) -> tuple[Number, Number]:
    """Return the components of vectors that are rotated by ``angle`` [rad], counter-clockwise."""
    c, s = cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


def rotate(vector: Array, angle: Array) -> Array:
    """Rotate vectors, shape (..., 2), by ``angle`` [rad], shape (...), counter-clockwise."""
    x, y = split(vector)
    return join(*rotated(x, y, number(angle)))


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
    return join(*rotated(v, offset * w, number(yaw)))


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
    v, across = rotated(x, y, -number(yaw))
    return join(v, across / offset)
