"""The space in which the controlled point may be: a box without the discs of known bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array

#: Bounds in the plane: x low, x high, y low, y high [m].
Bounds = tuple[float, float, float, float]

#: The whole plane.
EVERYWHERE: Bounds = (-math.inf, math.inf, -math.inf, math.inf)

#: Depth by which a path may enter a disc [m]; it allows for rounding where a path touches a circle.
_SLACK = 1e-3


class Disc(NamedTuple):
    """A disc that the controlled point keeps out of.

    Attributes:
        name: Name of the body that stands there.
        x: Middle along x [m].
        y: Middle along y [m].
        radius: Radius of the body, plus where it says so that of the unit and a margin [m].
    """

    name: str
    x: float
    y: float
    radius: float


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """The space in which the controlled point may be.

    Attributes:
        box: Bounds: x low, x high, y low, y high [m].
        discs: Discs to keep out of.
    """

    box: Bounds
    discs: tuple[Disc, ...]

    @cached_property
    def _centres(self) -> Array:
        return np.array([(d.x, d.y) for d in self.discs]).reshape(-1, 2)

    @cached_property
    def _radii(self) -> Array:
        return np.array([d.radius for d in self.discs])

    def opened_at(self, x: float, y: float) -> FreeSpace:
        """Return this space, enlarged as little as necessary to contain (x, y), where the unit stands."""
        x0, x1, y0, y1 = self.box
        box = (min(x0, x), max(x1, x), min(y0, y), max(y1, y))
        discs = tuple(
            d._replace(radius=min(d.radius, max(float(np.hypot(d.x - x, d.y - y)) - _SLACK, _SLACK)))
            for d in self.discs
        )
        return FreeSpace(box, discs)

    def near_circle(self, x: float, y: float, radius: float) -> FreeSpace | None:
        """Return this space with only the discs that a circle [m] may enter; None if all of it is free."""
        touch = 0.5 * _SLACK  # a circle may be that of a disc, or touch one, and rounding lets it enter
        discs = tuple(d for d in self.discs if abs(math.hypot(d.x - x, d.y - y) - radius) < d.radius - touch)
        x0, x1, y0, y1 = self.box
        inside = x0 <= x - radius and x + radius <= x1 and y0 <= y - radius and y + radius <= y1
        return None if inside and not discs else FreeSpace(self.box, discs)

    def allows(self, points: Array) -> bool:
        """Return whether all of the points, shape (N, 2) [m], are free."""
        return bool(self._inside(points).all()) and self.deepest_disc(points) is None

    def free_points(self, points: Array) -> NDArray[np.bool_]:
        """Return which of the points, shape (N, 2) [m], are free, shape (N,)."""
        dx, dy = points[:, :1] - self._centres[:, 0], points[:, 1:] - self._centres[:, 1]
        clear = np.sqrt(dx * dx + dy * dy) >= self._radii - _SLACK
        return np.asarray(clear.all(axis=-1) & self._inside(points))

    def deepest_disc(self, points: Array) -> Disc | None:
        """Return the disc that the points, shape (N, 2) [m], enter deepest, None if they enter none."""
        if not self.discs:
            return None
        dx, dy = points[:, :1] - self._centres[:, 0], points[:, 1:] - self._centres[:, 1]
        distance = np.sqrt(dx * dx + dy * dy).min(axis=0)
        depth = self._radii - _SLACK - distance
        deepest = int(depth.argmax())
        return self.discs[deepest] if depth[deepest] > 0.0 else None

    def allows_lines(self, a: Array, b: Array) -> NDArray[np.bool_]:
        """Return which lines from ``a`` to ``b``, each of shape (N, 2) [m], are free, shape (N,)."""
        free: NDArray[np.bool_] = self._inside(a) & self._inside(b)
        if self.discs:
            along = b - a
            square = np.maximum(np.sum(along * along, axis=-1), 1e-12)[:, None]
            to_centres = self._centres - a[:, None]
            share = np.sum(to_centres * along[:, None], axis=-1) / square
            nearest = a[:, None] + np.minimum(np.maximum(share, 0.0), 1.0)[..., None] * along[:, None]
            distance = np.linalg.norm(nearest - self._centres, axis=-1)
            free = free & (distance >= self._radii - _SLACK).all(axis=-1)
        return free

    def _inside(self, points: Array) -> NDArray[np.bool_]:
        x0, x1, y0, y1 = self.box
        x, y = points[:, 0], points[:, 1]
        inside: NDArray[np.bool_] = (
            (x >= x0 - _SLACK) & (x <= x1 + _SLACK) & (y >= y0 - _SLACK) & (y <= y1 + _SLACK)
        )
        return inside
