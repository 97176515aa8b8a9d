"""Lens distortion in the model of Brown and Conrady, with the names and the order of OpenCV and ROS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.pinhole import PinholeCamera, Window

#: Steps of Newton's method. It converges quadratically; the number is fixed so that each point's result is a
#: function of that point alone.
_STEPS = 7

#: Largest distance between a point and the image of what :meth:`Distortion.undo` found for it.
_RESIDUAL = 1e-9

#: Most that neighbouring pixels may be apart in the image of an ideal lens [px]; more is a fold of the lens.
_MOST_STRETCH = 4.0


@dataclass(frozen=True, slots=True)
class Distortion:
    """Lens distortion of Brown and Conrady; it maps points of the plane z = 1 of an ideal camera.

    Attributes:
        k1: Radial coefficient of the second order.
        k2: Radial coefficient of the fourth order.
        p1: Tangential coefficient, along y.
        p2: Tangential coefficient, along x.
        k3: Radial coefficient of the sixth order.
        aspect: Height over width of the image of a square in the middle, fy over fx.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    aspect: float = 1.0

    def apply(self, points: Array) -> Array:
        """Return where the lens shows points of the plane z = 1 of an ideal camera, both of shape (N, 2)."""
        x, y = points[:, 0], points[:, 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        return np.column_stack(
            [
                radial * x + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
                self.aspect * (radial * y + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y),
            ]
        )

    def undo(self, points: Array) -> Array:
        """Return the points of the plane z = 1 that the lens shows at ``points``, both of shape (N, 2).

        A point is NaN where none was found. Where the lens folds the plane, it is one of several.
        """
        x, y = points[:, 0], points[:, 1] / self.aspect
        with np.errstate(all="ignore"):  # where there is no inverse, the steps lead anywhere
            for _ in range(_STEPS):
                shown = self.apply(np.column_stack([x, y]))
                ex, ey = shown[:, 0] - points[:, 0], (shown[:, 1] - points[:, 1]) / self.aspect
                a, b, d = self._slopes(x, y)
                determinant = a * d - b * b
                x, y = x - (d * ex - b * ey) / determinant, y - (a * ey - b * ex) / determinant
            found = np.column_stack([x, y])
            error = np.abs(self.apply(found) - points).max(axis=1)
            return np.where((error < _RESIDUAL)[:, np.newaxis], found, np.nan)

    def jacobian(self, points: Array) -> Array:
        """Return the derivatives of what :meth:`apply` returns for ``points`` (N, 2), shape (N, 2, 2)."""
        a, b, d = self._slopes(points[:, 0], points[:, 1])
        rows = np.stack([np.stack([a, b], axis=-1), self.aspect * np.stack([b, d], axis=-1)], axis=-2)
        return np.asarray(rows)

    def _slopes(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Return the derivatives of x by x, of x by y (which is y by x), and of y by y, the aspect aside."""
        r2 = x * x + y * y
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        slope = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + 3.0 * r2 * self.k3))
        a = radial + slope * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x
        b = slope * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y
        d = radial + slope * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x
        return a, b, d

    def ideal_pixels(self, camera: PinholeCamera, pixels: Array) -> Array:
        """Return where an ideal lens would show what this one shows at ``pixels``, both of shape (N, 2)."""
        plane = self.undo(camera.rays(pixels)[:, :2])
        return camera.project(np.column_stack([plane, np.ones(len(plane))]))

    def lens_pixels(self, camera: PinholeCamera, pixels: Array) -> Array:
        """Return where this lens shows what an ideal one would show at ``pixels``, both of shape (N, 2)."""
        shown = self.apply(camera.rays(pixels)[:, :2])
        return camera.project(np.column_stack([shown, np.ones(len(shown))]))


#: A lens that does not distort.
IDEAL_LENS = Distortion()

#: Names of the coefficients, in the order of OpenCV and ROS.
COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3")

#: Margin about the frame in which a lens has to have an inverse, for blur [px], and spacing of its test [px].
_MARGIN, _SPACING = 8, 8.0


def has_inverse(camera: PinholeCamera, distortion: Distortion) -> bool:
    """Return whether every pixel of the frame and of a small margin shows one point of the scene."""
    return _is_slight(camera, distortion) or fold_radius(camera, distortion) is None


def no_inverse(distortion: Distortion, window: Window) -> GeometryError:
    """Return the error that a lens shows two points of the scene at one pixel of a window."""
    return GeometryError(
        f"the polynomial of the lens {distortion} has no inverse in {window}: two points of the scene appear "
        "at one pixel; use smaller coefficients or a smaller field of view"
    )


def _is_slight(camera: PinholeCamera, distortion: Distortion) -> bool:
    """Return whether a lens moves points by less than a third of their distances, and folds nothing.

    Points of the frame then are at most 1.5 times as far from the axis as the lens shows them.
    """
    across = max(camera.cx, camera.width - camera.cx), max(camera.cy, camera.height - camera.cy)
    shown = (float(np.hypot(*across)) + 2.0 * _MARGIN) / (camera.focal * min(1.0, distortion.aspect))
    r = 1.5 * shown
    radial = 3.0 * abs(distortion.k1) * r**2 + 5.0 * abs(distortion.k2) * r**4
    radial += 7.0 * abs(distortion.k3) * r**6
    return radial + 8.0 * (abs(distortion.p1) + abs(distortion.p2)) * r < 1.0 / 3.0


def fold_radius(camera: PinholeCamera, distortion: Distortion) -> float | None:
    """Return how far from the principal point the lens has an inverse in every direction [px].

    It is exact to 12 px; None if the lens has an inverse in the whole frame and a small margin.
    """
    columns, rows = _border_nodes(camera.width), _border_nodes(camera.height)
    folded = _folded_nodes(camera, distortion, columns, rows)
    if not folded.any():
        return None
    distance = np.hypot(columns - camera.cx, (rows - camera.cy)[:, np.newaxis])
    return float(distance[folded].min())


def _border_nodes(size: int) -> Array:
    """Return places along an edge of the frame [px], every pixel near its ends, where lenses fold first."""
    first, last = -_MARGIN - 0.5, size + _MARGIN - 0.5
    fine = np.arange(2.0 * _MARGIN + 1.0)
    return np.unique(np.concatenate([np.arange(first, last, _SPACING), first + fine, last - fine]))


def _folded_nodes(
    camera: PinholeCamera, distortion: Distortion, columns: Array, rows: Array
) -> NDArray[np.bool_]:
    """Return beside which nodes of a grid of pixels the lens folds the image, shape (rows, columns).

    Two points of the scene appear at one pixel there, or a pixel shows none. Columns, shape (C,), and rows,
    shape (R,), of the nodes increase [px].
    """
    nodes = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2).astype(np.float64)
    grid: Array = distortion.ideal_pixels(camera, nodes).reshape(len(rows), len(columns), 2)
    folded = np.zeros(grid.shape[:2], dtype=np.bool_)
    for rise, step, first, second in (
        (np.diff(grid[..., 0], axis=1), np.diff(columns), folded[:, :-1], folded[:, 1:]),
        (np.diff(grid[..., 1], axis=0), np.diff(rows)[:, np.newaxis], folded[:-1], folded[1:]),
    ):
        fold = ~((rise > 0.0) & (rise < _MOST_STRETCH * step))  # comparisons with NaN are false
        first |= fold
        second |= fold
    return folded
