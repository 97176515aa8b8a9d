"""How tag corners of the target appear in the docking unit's camera, with analytic derivatives.

The planar pose X_DU has three degrees of freedom. A small pitch and roll of the docking unit against the
target are carried along, because 0.2 degrees of pitch look like 10 mm of distance at 0.8 m.
"""

from __future__ import annotations

import numpy as np

from msrr_perception.kernels import project as kernels
from msrr_perception.kernels.project import NEAREST_M
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3

__all__ = ["NEAREST_M", "PITCH", "ROLL", "YAW", "X", "Y", "pose_vector", "project", "project_with_jacobian"]

#: Entries of a pose-and-tilt vector.
X, Y, YAW, PITCH, ROLL = range(5)


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
    x, y, yaw, pitch, roll = (float(a) for a in pose)
    X_DU = SE3.from_xyz_rpy([x, y, 0.0], [roll, pitch, yaw])
    p_C = (target.X_CU @ X_DU.inverse()).act(points_D)
    in_front = p_C.copy()
    in_front[:, 2] = np.maximum(p_C[:, 2], NEAREST_M)
    return p_C, target.camera.project(in_front)


def project_with_jacobian(target: TargetModel, pose: Array, points_D: Array) -> tuple[Array, Array]:
    """Return pixels, shape (2 N,), ordered u0, v0, u1, v1 ..., and their derivatives, shape (2 N, 5).

    The derivatives are by ``(x, y, yaw, pitch, roll)``. Points behind the camera are taken to lie
    ``NEAREST_M`` in front of it, which gives a huge residual instead of a mirrored image.
    """
    pixels, jacobian = kernels.project_with_jacobian(target.optics, pose, np.ascontiguousarray(points_D))
    return pixels, jacobian
