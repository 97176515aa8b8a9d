"""The pinhole camera and pixel windows, shared by renderers and perception.

Pixels are counted from pixel centres, as in OpenCV: the centre of the upper left pixel is (0, 0) and
the image spans [-0.5, W - 0.5] x [-0.5, H - 0.5]. The camera frame C is OpenCV's: z forward, x right,
y down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se3 import SE3

#: Rotation from the optical frame C (z forward, x right, y down) to a body-style frame (x forward, y left,
#: z up): the columns are C's axes in that frame.
R_BODY_OPTICAL: Array = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of whole pixels: columns x .. x + width - 1, rows y .. y + height - 1."""

    x: int
    y: int
    width: int
    height: int

    @property
    def x_end(self) -> int:
        """First column to the right of the window."""
        return self.x + self.width

    @property
    def y_end(self) -> int:
        """First row below the window."""
        return self.y + self.height

    @property
    def area(self) -> int:
        """Number of pixels."""
        return self.width * self.height

    def contains(self, other: Window) -> bool:
        """Return whether ``other`` lies inside this window."""
        return (
            self.x <= other.x
            and self.y <= other.y
            and other.x_end <= self.x_end
            and other.y_end <= self.y_end
        )

    def padded(self, margin: int) -> Window:
        """Return the window grown by ``margin`` pixels on all sides."""
        return Window(self.x - margin, self.y - margin, self.width + 2 * margin, self.height + 2 * margin)

    def intersection(self, other: Window) -> Window | None:
        """Return the common pixels, or None when there are none."""
        x, y = max(self.x, other.x), max(self.y, other.y)
        w, h = min(self.x_end, other.x_end) - x, min(self.y_end, other.y_end) - y
        return Window(x, y, w, h) if w > 0 and h > 0 else None

    @classmethod
    def around(cls, pixels: ArrayLike, margin: float) -> Window:
        """Return the smallest window that holds all ``pixels``, shape (N, 2), with ``margin`` [px]."""
        p = np.asarray(pixels, dtype=np.float64)
        lo = np.floor(p.min(axis=0) - margin).astype(int)
        hi = np.ceil(p.max(axis=0) + margin).astype(int)
        return cls(int(lo[0]), int(lo[1]), int(hi[0] - lo[0] + 1), int(hi[1] - lo[1] + 1))


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """Intrinsics of a distortion-free camera with square pixels.

    Attributes:
        width: Image width [px].
        height: Image height [px].
        focal: Focal length [px].
        offset: Place (column, row) of the principal point from the middle of the image [px].
    """

    width: int
    height: int
    focal: float
    offset: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def from_hfov(cls, width: int, height: int, hfov: float) -> PinholeCamera:
        """Build from the horizontal field of view [rad]."""
        return cls(width, height, 0.5 * width / math.tan(0.5 * hfov))

    @property
    def cx(self) -> float:
        """Column of the principal point [px]."""
        return 0.5 * (self.width - 1) + self.offset[0]

    @property
    def cy(self) -> float:
        """Row of the principal point [px]."""
        return 0.5 * (self.height - 1) + self.offset[1]

    @property
    def frame(self) -> Window:
        """The window that is the full frame."""
        return Window(0, 0, self.width, self.height)

    def matrix(self) -> Array:
        """Return K, shape (3, 3)."""
        return np.array([[self.focal, 0.0, self.cx], [0.0, self.focal, self.cy], [0.0, 0.0, 1.0]])

    def project(self, p_C: ArrayLike) -> Array:
        """Project points of the camera frame, shape (..., 3) [m], to pixels, shape (..., 2).

        The points have to lie in front of the camera (z > 0); the pixels of others are meaningless.
        """
        p = np.asarray(p_C, dtype=np.float64)
        z = p[..., 2]
        return np.stack([self.focal * p[..., 0] / z + self.cx, self.focal * p[..., 1] / z + self.cy], axis=-1)

    def rays(self, pixels: ArrayLike) -> Array:
        """Return the directions (x, y, 1) in C, shape (..., 3), of pixels, shape (..., 2)."""
        u = np.asarray(pixels, dtype=np.float64)
        x = (u[..., 0] - self.cx) / self.focal
        y = (u[..., 1] - self.cy) / self.focal
        return np.stack([x, y, np.ones_like(x)], axis=-1)

    def bearing(self, column: ArrayLike) -> Array:
        """Return the horizontal angle [rad], counter-clockwise (left) positive, of image columns [px]."""
        return np.arctan2(self.cx - np.asarray(column, dtype=np.float64), self.focal)

    def contains(self, pixels: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which pixels, shape (..., 2), lie inside the image by at least ``margin`` [px]."""
        u, v = pixels[..., 0], pixels[..., 1]
        inside: NDArray[np.bool_] = (
            (u >= margin - 0.5)
            & (u <= self.width - 0.5 - margin)
            & (v >= margin - 0.5)
            & (v <= self.height - 0.5 - margin)
        )
        return inside


def body_pose(X_UC: SE3) -> SE3:
    """Return the body-style camera frame B (x forward) at an optical frame C: ``X_UB`` from ``X_UC``."""
    return X_UC @ SE3(R_BODY_OPTICAL.T, np.zeros(3))


def optical_pose(X_UB: SE3) -> SE3:
    """Return the optical frame C at a body-style camera frame B (x forward): ``X_UC`` from ``X_UB``."""
    return X_UB @ SE3(R_BODY_OPTICAL, np.zeros(3))
