"""The ground a unit may drive over, as far as it is known: an arena and round bodies in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array

#: What a path may come nearer than it should; it makes up for rounding where a path touches a circle [m].
_SLACK = 1e-3


class Disc(NamedTuple):
    """Ground that the controlled point keeps out of.

    Attributes:
        name: Body that stands there.
        x: Middle [m].
        y: Middle [m].
        radius: The body's, with the unit's own and a margin [m].
    """

    name: str
    x: float
    y: float
    radius: float


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Where the controlled point may be.

    Attributes:
        box: Its bounds: x low, x high, y low, y high [m].
        discs: What stands in it.
    """

    box: tuple[float, float, float, float]
    discs: tuple[Disc, ...]
    _centres: Array = field(init=False, repr=False)
    _radii: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_centres", np.array([(d.x, d.y) for d in self.discs]).reshape(-1, 2))
        object.__setattr__(self, "_radii", np.array([d.radius for d in self.discs]))

    def left_from(self, x: float, y: float) -> FreeSpace:
        """Return the ground for a unit that stands at (x, y) already, be it forbidden.

        Discs and bounds give way as far as it takes to stand there, not further.
        """
        x0, x1, y0, y1 = self.box
        box = (min(x0, x), max(x1, x), min(y0, y), max(y1, y))
        discs = tuple(
            d._replace(radius=min(d.radius, max(float(np.hypot(d.x - x, d.y - y)) - _SLACK, _SLACK)))
            for d in self.discs
        )
        return FreeSpace(box, discs)

    def allows(self, points: Array) -> bool:
        """Say whether all of the points, shape (N, 2) [m], may be driven over."""
        return bool(self._inside(points).all()) and self.hit(points) is None

    def hit(self, points: Array) -> Disc | None:
        """Return the disc that the points, shape (N, 2), run into deepest, None if none."""
        if not self.discs:
            return None
        apart = np.linalg.norm(points[:, None] - self._centres, axis=-1).min(axis=0)
        depth = self._radii - _SLACK - apart
        deepest = int(depth.argmax())
        return self.discs[deepest] if depth[deepest] > 0.0 else None

    def allows_lines(self, a: Array, b: Array) -> NDArray[np.bool_]:
        """Say which lines from ``a`` to ``b``, each of shape (N, 2), may be driven along, shape (N,)."""
        free: NDArray[np.bool_] = self._inside(a) & self._inside(b)
        if self.discs:
            along = b - a
            square = np.maximum(np.sum(along * along, axis=-1), 1e-12)[:, None]
            to = self._centres - a[:, None]
            share = np.sum(to * along[:, None], axis=-1) / square
            nearest = a[:, None] + np.minimum(np.maximum(share, 0.0), 1.0)[..., None] * along[:, None]
            apart = np.linalg.norm(nearest - self._centres, axis=-1)
            free = free & (apart >= self._radii - _SLACK).all(axis=-1)
        return free

    def _inside(self, points: Array) -> NDArray[np.bool_]:
        x0, x1, y0, y1 = self.box
        x, y = points[:, 0], points[:, 1]
        inside: NDArray[np.bool_] = (
            (x >= x0 - _SLACK) & (x <= x1 + _SLACK) & (y >= y0 - _SLACK) & (y <= y1 + _SLACK)
        )
        return inside
