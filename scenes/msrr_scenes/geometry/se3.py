"""SE(3): poses in space, in the monogram notation of :mod:`msrr_scenes.geometry.se2`."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from msrr_scenes.arrays import Array, frozen
from msrr_scenes.geometry.se2 import SE2


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3), the convention of URDF [rad]."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


@dataclass(frozen=True, eq=False)
class SE3:
    """A rigid motion of space.

    Attributes:
        R: Rotation matrix, shape (3, 3), read-only.
        p: Translation, shape (3,) [m], read-only.
    """

    R: Array = field(default_factory=lambda: np.eye(3))
    p: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", frozen(np.array(self.R, dtype=np.float64).reshape(3, 3)))
        object.__setattr__(self, "p", frozen(np.array(self.p, dtype=np.float64).reshape(3)))

    @classmethod
    def from_xyz_rpy(cls, xyz: ArrayLike, rpy: ArrayLike) -> SE3:
        """Build from a translation (3,) [m] and roll, pitch, yaw (3,) [rad] in the URDF convention."""
        roll, pitch, yaw = np.asarray(rpy, dtype=np.float64).tolist()
        return cls._of(rotation_from_rpy(roll, pitch, yaw), np.array(xyz, dtype=np.float64).reshape(3))

    @classmethod
    def from_quaternion_xyzw(cls, p: ArrayLike, quaternion_xyzw: Iterable[float]) -> SE3:
        """Build from a translation (3,) [m] and a quaternion (4,) ordered x, y, z, w (any length > 0)."""
        x, y, z, w = (float(a) for a in quaternion_xyzw)
        k = 2.0 / (x * x + y * y + z * z + w * w)
        R = np.array(
            [
                [1.0 - k * (y * y + z * z), k * (x * y - z * w), k * (x * z + y * w)],
                [k * (x * y + z * w), 1.0 - k * (x * x + z * z), k * (y * z - x * w)],
                [k * (x * z - y * w), k * (y * z + x * w), 1.0 - k * (x * x + y * y)],
            ]
        )
        return cls._of(R, np.array(p, dtype=np.float64))

    @classmethod
    def _of(cls, R: Array, p: Array) -> SE3:
        """Build from arrays that nobody else holds, without a copy: poses are made at every tick."""
        X = object.__new__(cls)
        R.flags.writeable = p.flags.writeable = False
        object.__setattr__(X, "R", R)
        object.__setattr__(X, "p", p)
        return X

    @classmethod
    def from_se2(cls, X: SE2, z: float = 0.0) -> SE3:
        """Lift a planar pose to height ``z`` [m]."""
        return cls._of(rotation_from_rpy(0.0, 0.0, X.yaw), np.array([X.x, X.y, z]))

    def to_se2(self) -> SE2:
        """Project to the plane: x, y and the heading of the x axis."""
        return SE2(float(self.p[0]), float(self.p[1]), math.atan2(float(self.R[1, 0]), float(self.R[0, 0])))

    def quaternion_xyzw(self) -> Array:
        """Return the unit quaternion (4,), ordered x, y, z, w, with w >= 0."""
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self.R.tolist()
        trace = xx + yy + zz
        largest = max(xx, yy, zz, trace)
        # Shepperd's method: divide by the largest of the four candidates, never by a small one.
        if largest == trace:
            q = zy - yz, xz - zx, yx - xy, 1.0 + trace
        elif largest == xx:
            q = 1.0 + 2.0 * xx - trace, yx + xy, zx + xz, zy - yz
        elif largest == yy:
            q = yx + xy, 1.0 + 2.0 * yy - trace, zy + yz, xz - zx
        else:
            q = zx + xz, zy + yz, 1.0 + 2.0 * zz - trace, yx - xy
        length = math.copysign(math.hypot(*q), q[3])
        return np.array(q) / length

    def rpy(self) -> Array:
        """Return roll, pitch, yaw (3,) [rad] in the URDF convention; at a pitch of 90 deg one of many."""
        (xx, xy, xz), (yx, yy, yz), (zx, _, _) = self.R.tolist()
        yaw = math.atan2(yx, xx)
        # Roll and pitch are those of the rotation without this yaw, which is exact at any pitch.
        c, s = math.cos(yaw), math.sin(yaw)
        return np.array([math.atan2(s * xz - c * yz, c * yy - s * xy), math.atan2(-zx, c * xx + s * yx), yaw])

    def __matmul__(self, other: SE3) -> SE3:
        """Compose: ``X_AC = X_AB @ X_BC``."""
        return SE3._of(self.R @ other.R, self.R @ other.p + self.p)

    def inverse(self) -> SE3:
        """Return ``X_BA`` of this ``X_AB``."""
        return SE3._of(self.R.T.copy(), -self.R.T @ self.p)

    def act(self, points: ArrayLike) -> Array:
        """Map points of frame B, shape (..., 3) [m], into frame A."""
        moved: Array = np.asarray(points, dtype=np.float64) @ self.R.T + self.p
        return moved

    def matrix(self) -> Array:
        """Return the homogeneous (4, 4) matrix."""
        M = np.eye(4)
        M[:3, :3] = self.R
        M[:3, 3] = self.p
        return M
