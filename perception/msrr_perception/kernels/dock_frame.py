"""The pose in the dock frame; see :mod:`msrr_perception.estimation.dock_frame`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from msrr_perception.kernels.compiled import kernel
from msrr_perception.kernels.drive import propagate
from msrr_scenes.arrays import Array

#: Entries of a state on which the pose in the dock frame depends: the pose against the marker of the port,
#: and the place of that marker.
_SHARES = 6


@kernel
def pose_by_marker(mean: Array, marker: int, pivot: Array) -> tuple[Array, Array]:
    """Return the pose in the dock frame, shape (3,), and its derivatives, shape (3, 6).

    The yaw is not wrapped: it is the sum of those of the pose and of the marker.

    Args:
        mean: State, shape (n,), that begins with the pose against the marker.
        marker: Index of the place (x, y, yaw) of the marker in the state; -1 if it is as designed.
        pivot: Middle of its reference tag, about which it turns, shape (3,) [m].

    Returns:
        Pose, and derivatives by the pose against the marker and by the place of the marker.
    """
    pose, J = mean[:3].copy(), np.zeros((3, _SHARES))
    for i in range(3):
        J[i, i] = J[i, i + 3] = 1.0
    if marker >= 0:
        turn = mean[marker + 2]
        c, s, x, y = math.cos(turn), math.sin(turn), mean[0] - pivot[0], mean[1] - pivot[1]
        dx, dy = c * x - s * y, s * x + c * y
        pose[0], pose[1] = pivot[0] + mean[marker] + dx, pivot[1] + mean[marker + 1] + dy
        pose[2] = mean[2] + turn
        J[0, 0], J[0, 1], J[1, 0], J[1, 1] = c, -s, s, c
        J[0, 5], J[1, 5] = -dy, dx
    return pose, J


@kernel
def predict(
    mean: Array, covariance: Array, steps: Array, packed: NDArray[np.void], marker: int, pivot: Array
) -> tuple[float, float, float, Array]:
    """Return the pose (x, y, yaw) in the dock frame after K steps, and its covariance, shape (3, 3).

    Args:
        mean: State, shape (n,).
        covariance: Covariance of the state, shape (n, n).
        steps: Steps of :func:`msrr_perception.kernels.drive.propagate`, shape (K, 5).
        packed: Drive and its noise, :meth:`msrr_perception.kernels.drive.Drive.packed`.
        marker: See :func:`pose_by_marker`.
        pivot: See :func:`pose_by_marker`.
    """
    if len(steps):
        mean, covariance = mean.copy(), covariance.copy()
        propagate(mean, covariance, steps, packed)
    pose, J = pose_by_marker(mean, marker, pivot)
    out = np.zeros((3, 3))
    shares = _SHARES if marker >= 0 else 3
    for a in range(shares):
        for b in range(shares):
            entry = covariance[a if a < 3 else marker + a - 3, b if b < 3 else marker + b - 3]
            for i in range(3):
                for j in range(i + 1):
                    out[i, j] += J[i, a] * entry * J[j, b]
    for i in range(3):
        for j in range(i):
            out[j, i] = out[i, j]
    return pose[0], pose[1], pose[2], out
