"""How tag corners of the target appear in the docking unit's camera, with analytic derivatives.

The planar pose X_DU has three degrees of freedom. A small pitch and roll of the docking unit against the
target are carried along, because 0.2 degrees of pitch look like 10 mm of distance at 0.8 m.
"""

from __future__ import annotations

import math

import numpy as np

from msrr_perception.target import TargetModel
from msrr_scenes.messages import Array
from msrr_scenes.se2 import SE2

#: Entries of a pose-and-tilt vector.
X, Y, YAW, PITCH, ROLL = range(5)

#: Points nearer to the image plane than this have no usable projection [m].
NEAREST_M = 0.01


def pose_vector(X_DU: SE2, pitch: float = 0.0, roll: float = 0.0) -> Array:
    """Return ``(x, y, yaw, pitch, roll)``, shape (5,) [m, rad]."""
    return np.array([X_DU.x, X_DU.y, X_DU.yaw, pitch, roll])


def project(target: TargetModel, pose: Array, points_D: Array) -> tuple[Array, Array]:
    """Project points of the target into the camera.

    U stands in D at ``Rz(yaw) Ry(pitch) Rx(roll)`` and (x, y, 0).

    Args:
        target: Camera and mounting.
        pose: ``(x, y, yaw, pitch, roll)`` [m, rad].
        points_D: Shape (N, 3) [m].

    Returns:
        Points in the camera frame C, shape (N, 3) [m], and their pixels, shape (N, 2), which mean nothing
        where z is not positive.
    """
    p_C, _ = _camera_points(target, pose, points_D)
    z = np.where(p_C[2] > NEAREST_M, p_C[2], NEAREST_M)
    pixels = np.stack(
        [
            target.camera.focal * p_C[0] / z + target.camera.cx,
            target.camera.focal * p_C[1] / z + target.camera.cy,
        ],
        axis=1,
    )
    return p_C.T, pixels


def project_with_jacobian(target: TargetModel, pose: Array, points_D: Array) -> tuple[Array, Array]:
    """Return pixels, shape (2 N,), ordered u0, v0, u1, v1 ..., and their derivatives, shape (2 N, 5).

    The derivatives are by ``(x, y, yaw, pitch, roll)``. Points behind the camera are taken to lie
    ``NEAREST_M`` in front of it, which gives a huge residual instead of a mirrored image.
    """
    p_C, dp_C = _camera_points(target, pose, points_D)
    f = target.camera.focal
    inv_z = 1.0 / np.maximum(p_C[2], NEAREST_M)
    u, v = p_C[0] * inv_z, p_C[1] * inv_z
    n = points_D.shape[0]
    pixels = np.empty(2 * n)
    pixels[0::2] = f * u + target.camera.cx
    pixels[1::2] = f * v + target.camera.cy
    jacobian = np.empty((2 * n, 5))
    scale = f * inv_z
    jacobian[0::2] = (scale * (dp_C[:, 0] - u * dp_C[:, 2])).T
    jacobian[1::2] = (scale * (dp_C[:, 1] - v * dp_C[:, 2])).T
    return pixels, jacobian


def _camera_points(target: TargetModel, pose: Array, points_D: Array) -> tuple[Array, Array]:
    """Return points in C, shape (3, N), and their derivatives by the pose, shape (5, 3, N)."""
    x, y, yaw, pitch, roll = (float(a) for a in pose)
    cy, sy = math.cos(yaw), math.sin(yaw)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    dx, dy, z = points_D[:, 0] - x, points_D[:, 1] - y, points_D[:, 2]
    wx, wy = cy * dx + sy * dy, cy * dy - sy * dx  # after undoing the yaw
    # Undoing pitch, then roll, is the constant matrix M = Rx(roll)^T Ry(pitch)^T.
    M = np.array([[cp, 0.0, -sp], [sr * sp, cr, sr * cp], [cr * sp, -sr, cr * cp]])
    n = points_D.shape[0]
    stacked = np.empty((3, 6, n))  # columns: the point, then its derivative by each entry of the pose
    stacked[0, 0], stacked[1, 0], stacked[2, 0] = wx, wy, z
    stacked[0, 1], stacked[1, 1], stacked[2, 1] = -cy, sy, 0.0
    stacked[0, 2], stacked[1, 2], stacked[2, 2] = -sy, -cy, 0.0
    stacked[0, 3], stacked[1, 3], stacked[2, 3] = wy, -wx, 0.0
    # d(Ry^T w)/dpitch, pulled back through Ry so that M can act on it like on the others.
    stacked[0, 4], stacked[1, 4], stacked[2, 4] = -z, 0.0, wx
    stacked[:, 5] = 0.0  # the roll's follows from M w below
    out = (M @ stacked.reshape(3, 6 * n)).reshape(3, 6, n)
    out[0, 5] = 0.0
    out[1, 5] = out[2, 0]
    out[2, 5] = -out[1, 0]
    out[:, 0] -= target.X_UC.p[:, None]
    in_camera = (target.X_CU.R @ out.reshape(3, 6 * n)).reshape(3, 6, n)
    return in_camera[:, 0], in_camera[:, 1:].transpose(1, 0, 2)
