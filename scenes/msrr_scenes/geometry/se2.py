"""SE(2): poses in the plane, written in monogram notation (``X_WU`` is frame U seen from frame W)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from msrr_scenes.arrays import Array


def wrap_angle(angle: float) -> float:
    """Return ``angle`` [rad] wrapped to (-pi, pi]."""
    wrapped = math.remainder(angle, 2.0 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


@dataclass(frozen=True, slots=True)
class SE2:
    """A rigid motion of the plane.

    Attributes:
        x: Translation along x [m].
        y: Translation along y [m].
        yaw: Rotation, counter-clockwise positive [rad]; kept in (-pi, pi].
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def __post_init__(self) -> None:
        x, y, yaw = self.x, self.y, self.yaw
        if type(x) is type(y) is type(yaw) is float and -math.pi < yaw <= math.pi:
            return  # nearly all poses; wrapping would not change a bit of them
        object.__setattr__(self, "x", float(self.x))
        object.__setattr__(self, "y", float(self.y))
        object.__setattr__(self, "yaw", wrap_angle(float(self.yaw)))

    @classmethod
    def exp(cls, dx: float, dy: float, dyaw: float) -> SE2:
        """Integrate the constant body twist ``(dx, dy, dyaw)`` [m, m, rad] over unit time."""
        if abs(dyaw) < 1e-6:  # a series, because the quotients below are undefined at 0
            sinc, cosc = 1.0 - dyaw * dyaw / 6.0, dyaw / 2.0
        else:
            half = 0.5 * dyaw
            # The second is (1 - cos(dyaw)) / dyaw without cancellation.
            sinc, cosc = math.sin(dyaw) / dyaw, math.sin(half) ** 2 / half
        return cls(sinc * dx - cosc * dy, cosc * dx + sinc * dy, dyaw)

    def log(self) -> Array:
        """Return the body twist ``(dx, dy, dyaw)``, shape (3,), whose :meth:`exp` is this pose."""
        half = self.yaw / 2.0
        k = 1.0 - half * half / 3.0 if abs(half) < 1e-6 else half / math.tan(half)
        return np.array([k * self.x + half * self.y, -half * self.x + k * self.y, self.yaw])

    def __matmul__(self, other: SE2) -> SE2:
        """Compose: ``X_AC = X_AB @ X_BC``."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return SE2(
            self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, self.yaw + other.yaw
        )

    def inverse(self) -> SE2:
        """Return ``X_BA`` of this ``X_AB``."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return SE2(-c * self.x - s * self.y, s * self.x - c * self.y, -self.yaw)

    def act(self, points: ArrayLike) -> Array:
        """Map points of frame B, shape (..., 2) [m], into frame A."""
        p = np.asarray(points, dtype=np.float64)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.stack(
            [self.x + c * p[..., 0] - s * p[..., 1], self.y + s * p[..., 0] + c * p[..., 1]], axis=-1
        )

    def rotate_covariance(self, covariance: Array) -> Array:
        """Return a covariance of (x, y, yaw) along the axes of frame B along those of frame A, (3, 3)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        rotated: Array = turn @ covariance @ turn.T
        return rotated

    @property
    def translation(self) -> Array:
        """Position, shape (2,) [m]."""
        return np.array([self.x, self.y])

    def as_array(self) -> Array:
        """Return ``(x, y, yaw)``, shape (3,) [m, m, rad]."""
        return np.array([self.x, self.y, self.yaw])
