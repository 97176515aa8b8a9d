"""The controlled point ahead of (or behind) the axle, through which a differential drive moves freely."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rotate(vector: Array, angle: Array) -> Array:
    """Rotate vectors, shape (..., 2), by ``angle`` [rad], shape (...), counter-clockwise."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    turned = np.empty(np.broadcast_shapes(vector.shape, (*np.shape(angle), 2)))
    turned[..., 0] = c * x - s * y
    turned[..., 1] = s * x + c * y
    return turned


def offset_point(pose: Array, offset: float) -> Array:
    """Return the controlled point p_l.

    Source: Zheng et al., eq. 1 (the output).

    Args:
        pose: Axle pose (x, y, yaw) in some frame, shape (..., 3) [m, m, rad].
        offset: l, positive ahead of the axle, negative behind it [m].

    Returns:
        The point in the same frame, shape (..., 2) [m].
    """
    yaw = pose[..., 2]
    point = np.empty((*pose.shape[:-1], 2))
    point[..., 0] = pose[..., 0] + offset * np.cos(yaw)
    point[..., 1] = pose[..., 1] + offset * np.sin(yaw)
    return point


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
    body = np.empty(twist.shape)
    body[..., 0] = twist[..., 0]
    body[..., 1] = offset * twist[..., 1]
    return rotate(body, yaw)


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
    twist = rotate(velocity, np.negative(yaw))
    twist[..., 1] /= offset
    return twist
