"""A calibrated lens: where the image of a camera and that of an ideal camera in its place correspond."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.distortion import IDEAL_LENS, Distortion, fold_radius
from msrr_scenes.geometry.pinhole import PinholeCamera, Window

#: Distance of the pixels of the border by which the outline of the frame is computed [px].
_SPACING_PX = 8

#: Depth from which on a point lies in front of a camera [m].
_AHEAD_M = 1e-6


@dataclass(frozen=True)
class Lens:
    """A camera with its lens, and the ideal camera in whose image perception computes.

    The ideal camera has no distortion and square pixels; its focal length is fx and its principal point that
    of the camera. Its image is larger or smaller than the frame, and parts of it have negative pixels. What
    the lens shows of a point of the ideal image counts only where :meth:`shows` holds.

    Attributes:
        camera: The ideal camera.
        distortion: What the lens does to the image of the ideal camera.
    """

    camera: PinholeCamera
    distortion: Distortion = IDEAL_LENS

    @cached_property
    def distorts(self) -> bool:
        """Whether the frame differs from the image of the ideal camera."""
        return self.distortion != IDEAL_LENS

    def undistorted(self, pixels: Array) -> Array:
        """Return where the ideal camera sees what the frame shows at ``pixels``, both of shape (..., 2)."""
        if not self.distorts:
            return pixels
        return self.distortion.ideal_pixels(self.camera, pixels.reshape(-1, 2)).reshape(pixels.shape)

    def distorted(self, ideal: Array) -> Array:
        """Return where the frame shows what the ideal camera sees at ``ideal``, both of shape (..., 2)."""
        if not self.distorts:
            return ideal
        return self.distortion.lens_pixels(self.camera, ideal.reshape(-1, 2)).reshape(ideal.shape)

    def slopes(self, ideal: Array) -> Array:
        """Return the derivatives of :meth:`distorted` at points of the ideal image (N, 2): (N, 2, 2)."""
        # Both images have the focal length of the ideal camera, by which pixels cancel.
        return self.distortion.jacobian(self.camera.rays(ideal)[:, :2])

    def distorted_sigma(self, ideal: Array, sigma: Array) -> Array:
        """Return in the frame the standard deviations of points of the ideal image, all (..., 2) [px]."""
        if not self.distorts:
            return sigma
        J = self.slopes(ideal.reshape(-1, 2))
        variance = ((J * J) @ (sigma.reshape(-1, 2, 1) ** 2)).reshape(sigma.shape)
        return np.asarray(np.sqrt(variance))

    def shows(self, ideal: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which points of the ideal image (..., 2) the frame shows, ``margin`` [px] or more inside."""
        if not self.distorts:
            return self.camera.contains(ideal, margin)
        # Beyond where the polynomial folds the image, it leads back into the frame.
        near = ((ideal - [self.camera.cx, self.camera.cy]) ** 2).sum(axis=-1) <= self._reach**2
        shown: NDArray[np.bool_] = near & self.camera.contains(self.distorted(ideal), margin)
        return shown

    def sees(self, p_C: ArrayLike) -> NDArray[np.bool_]:
        """Return which points of the camera frame, shape (..., 3) [m], the frame shows."""
        p = np.asarray(p_C, dtype=np.float64)
        ahead = p[..., 2] > _AHEAD_M
        pixels = self.camera.project(np.where(ahead[..., None], p, np.array([0.0, 0.0, 1.0])))
        seen: NDArray[np.bool_] = ahead & self.shows(pixels)
        return seen

    @cached_property
    def bounds(self) -> Window:
        """The smallest window of the ideal image that holds all that the frame shows."""
        frame = self.camera.frame
        if not self.distorts:
            return frame
        return Window.around(self.undistorted(frame_outline(frame)), 0.0)

    @cached_property
    def inner_bounds(self) -> tuple[float, float, float, float]:
        """Lowest and highest column, lowest and highest row between which the frame shows all [px].

        In the ideal image, by the innermost point of each border of the frame.
        """
        outline = frame_outline(self.camera.frame)
        ideal = self.undistorted(outline)
        (u0, v0), (u1, v1) = outline.min(axis=0), outline.max(axis=0)
        return (
            float(ideal[outline[:, 0] == u0, 0].max()),
            float(ideal[outline[:, 0] == u1, 0].min()),
            float(ideal[outline[:, 1] == v0, 1].max()),
            float(ideal[outline[:, 1] == v1, 1].min()),
        )

    @cached_property
    def _reach(self) -> float:
        """Largest distance from the principal point of what the frame shows, in the ideal image [px]."""
        outline = self.undistorted(frame_outline(self.camera.frame)) - [self.camera.cx, self.camera.cy]
        return float(np.hypot(*outline.T).max()) + 1.0

    @cached_property
    def field_of_view(self) -> tuple[float, float]:
        """Angles from the axis to the left and the right border, in the row of the principal point [rad]."""
        camera = self.camera
        ends = np.array([[-0.5, camera.cy], [camera.width - 0.5, camera.cy]])
        left, right = self.undistorted(ends)[:, 0].tolist()
        return math.atan((camera.cx - left) / camera.focal), math.atan((right - camera.cx) / camera.focal)

    @property
    def half_fov(self) -> float:
        """The smaller of the two angles of :attr:`field_of_view` [rad]."""
        return min(self.field_of_view)


def frame_outline(frame: Window) -> Array:
    """Return points of the outline of a frame in their order around it, shape (N, 2) [px]."""
    x0, y0, x1, y1 = frame.x - 0.5, frame.y - 0.5, frame.x_end - 0.5, frame.y_end - 0.5
    across = np.linspace(0.0, 1.0, max(frame.width, frame.height) // _SPACING_PX + 2)[:-1, np.newaxis]
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return np.concatenate([start + across * (end - start) for start, end in sides])


def explained_fold(lens: Lens) -> str | None:
    """Return in words where a lens shows two points of the scene at one pixel of the frame, if it does."""
    radius, camera = fold_radius(lens.camera, lens.distortion), lens.camera
    if radius is None:
        return None
    corner = np.hypot(*(frame_outline(camera.frame) - [camera.cx, camera.cy]).T).max()
    return (
        f"with {lens.distortion} two points of the scene appear at one pixel: it has an inverse up to "
        f"about {radius:.0f} px from the principal point, and the frame reaches to {corner:.0f} px"
    )
