"""Footprints: the vertical projections of bodies onto the floor, as a few convex parts.

All bodies stand on the floor and move in the plane, so the distance of two bodies is that of their
footprints. An overhang counts as if it reached the floor, which can only make the distance smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.solid import Solid, convex_hull
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.placement.start_regions import obstacle_outline
from msrr_scenes.specs.bodies import BoxSpec, CylinderSpec

#: Two parts are merged when no point of their common hull is farther than this from the body [m].
MERGE_TOLERANCE = 1e-4
#: A part is removed when the other parts cover the border up to this distance [m].
COVER_TOLERANCE = 1e-6
#: Step with which the borders of parts are sampled [m].
BORDER_STEP = 5e-4
#: Decimals to which vertices are rounded [m]: a micrometre, so that duplicates of a corner coincide.
DECIMALS = 6


@dataclass(frozen=True, eq=False)
class Part:
    """A convex part of a footprint: all points within a radius of a core polygon.

    Attributes:
        core: Vertices, counter-clockwise, shape (N, 2) [m]; the core of a disc is the centre, N = 1.
        radius: Radius [m]; 0 for a polygon.
    """

    core: Array
    radius: float = 0.0

    @classmethod
    def polygon(cls, points: ArrayLike) -> Part:
        """Return the convex hull of ``points``, shape (N, 2) [m], not all on one line."""
        p = np.asarray(points, dtype=np.float64).round(DECIMALS)
        return cls(convex_hull(p))

    @classmethod
    def disc(cls, x: float, y: float, radius: float) -> Part:
        """Return a disc about ``(x, y)`` [m]."""
        return cls(np.array([[x, y]]), radius)

    @cached_property
    def centre(self) -> Array:
        """Centre of the bounding box of the core, shape (2,) [m]."""
        centre: Array = 0.5 * (self.core.min(axis=0) + self.core.max(axis=0))
        return centre

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        """Bounding box of the part: x low, y low, x high, y high [m]."""
        x0, y0 = (float(a) for a in self.core.min(axis=0) - self.radius)
        x1, y1 = (float(a) for a in self.core.max(axis=0) + self.radius)
        return x0, y0, x1, y1

    @cached_property
    def circumradius(self) -> float:
        """Radius of a circle about :attr:`centre` that contains the part [m]."""
        return float(np.linalg.norm(self.core - self.centre, axis=1).max()) + self.radius

    @cached_property
    def _edges(self) -> tuple[Array, ...]:
        """Edges of the core: x and y of the start, x and y to the end, squared length; shape (N,) each."""
        (ax, ay), (bx, by) = self.core.T, np.roll(self.core, -1, axis=0).T
        ex, ey = bx - ax, by - ay
        return ax, ay, ex, ey, np.maximum(ex * ex + ey * ey, np.finfo(float).tiny)

    def gap(self, points: ArrayLike) -> Array:
        """Return the distances of ``points``, shape (N, 2), from the part [m], shape (N,); 0 inside."""
        ax, ay, ex, ey, length2 = self._edges
        x, y = np.asarray(points, dtype=np.float64).T[..., None]
        dx, dy = x - ax, y - ay  # one row for each point
        t = np.minimum(np.maximum((dx * ex + dy * ey) / length2, 0.0), 1.0)
        u, v = dx - t * ex, dy - t * ey
        nearest = np.sqrt((u * u + v * v).min(axis=1))
        if len(self.core) > 2:
            inside = (ex * dy - ey * dx >= 0.0).all(axis=1)
            nearest = np.where(inside, 0.0, nearest)
        gap: Array = np.maximum(nearest - self.radius, 0.0)
        return gap

    def border(self) -> Array:
        """Return points on the border of the part at most :data:`BORDER_STEP` apart, shape (N, 2) [m]."""
        if len(self.core) == 1:
            n = max(8, int(np.ceil(2.0 * np.pi * self.radius / BORDER_STEP)))
            t = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
            ring: Array = self.core + self.radius * np.stack([np.cos(t), np.sin(t)], axis=1)
            return ring
        pieces = []
        for a, b in zip(self.core, np.roll(self.core, -1, axis=0), strict=True):
            n = int(np.ceil(np.linalg.norm(b - a) / BORDER_STEP)) + 1
            pieces.append(a + np.linspace(0.0, 1.0, n)[:, None] * (b - a))
        return np.concatenate(pieces)


def _all_near(points: Array, parts: Sequence[Part], distance: float) -> bool:
    """Return whether no point, shape (N, 2), is farther than ``distance`` [m] from the union of parts."""
    for part in parts:
        x0, y0, x1, y1 = part.box
        low, high = [x0 - distance, y0 - distance], [x1 + distance, y1 + distance]
        near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
        if near.size:  # of most parts no point is
            points = np.delete(points, near[part.gap(points[near]) <= distance], axis=0)
            if not len(points):
                return True
    return False


def _projection(solid: Solid) -> Part:
    if solid.is_disc:
        return Part.disc(float(solid.X_UG.p[0]), float(solid.X_UG.p[1]), solid.size[0])
    return Part.polygon(solid.outline())


def _common_hull(a: Part, b: Part, body: Sequence[Part]) -> Part | None:
    """Return the common hull of two polygons, or None when it is not inside the body."""
    hull = Part.polygon(np.concatenate([a.core, b.core]))
    # The middles of the edges decide nearly every case, at a small fraction of the cost.
    middles = 0.5 * (hull.core + np.roll(hull.core, -1, axis=0))
    for points in (middles, hull.border()):
        if not _all_near(points, body, MERGE_TOLERANCE):
            return None
    return hull


def _merge_one_pair(kept: Sequence[Part], body: Sequence[Part]) -> list[Part] | None:
    for a, b in combinations([p for p in kept if p.radius == 0.0], 2):
        if (hull := _common_hull(a, b, body)) is not None:
            return [p for p in kept if p is not a and p is not b] + [hull]
    return None


def _in_box(part: Part, other: Part) -> bool:
    """Return whether a part lies in the bounding box of another one, up to :data:`COVER_TOLERANCE`."""
    (a0, b0, a1, b1), (x0, y0, x1, y1) = part.box, other.box
    t = COVER_TOLERANCE
    return a0 >= x0 - t and b0 >= y0 - t and a1 <= x1 + t and b1 <= y1 + t


def _without_covered(parts: Sequence[Part], by_one_part: bool) -> list[Part]:
    """Remove the parts, smallest first, that lie in one other part, or in the union of all other parts."""
    kept = list(parts)
    for part in sorted(parts, key=lambda p: p.circumradius):
        others = [p for p in kept if p is not part]
        points = part.core if by_one_part and part.radius == 0.0 else part.border()
        groups = [others] if others else []
        if by_one_part:
            groups = [[p] for p in others if _in_box(part, p)]
        if any(_all_near(points, group, COVER_TOLERANCE) for group in groups):
            kept = others
    return kept


def simplify(parts: Sequence[Part]) -> tuple[Part, ...]:
    """Return fewer parts whose union is that of ``parts``, up to :data:`MERGE_TOLERANCE` outwards.

    Polygons are merged while the border of their common hull stays on the body; covered parts are removed.
    A hole that the parts enclose may be filled, because its rim is never nearest to another body.
    """
    kept = _without_covered(parts, by_one_part=True)
    # The largest part answers for most points, and then no other part is asked for them.
    body = sorted(kept, key=lambda part: -part.circumradius)
    while (fewer := _merge_one_pair(kept, body)) is not None:
        kept = _without_covered(fewer, by_one_part=True)
    return tuple(_without_covered(kept, by_one_part=False))


@lru_cache(maxsize=32)
def unit_parts(geometry: UnitGeometry) -> tuple[Part, ...]:
    """Return the footprint of a unit in U, with the pins of the front port.

    Raises:
        GeometryError: The unit has no collision shape.
    """
    if not geometry.solids:
        raise GeometryError(f"{geometry.urdf}: no collision shapes, so that no clearance can be measured")
    return simplify([_projection(solid) for solid in geometry.solids])


def obstacle_parts(spec: CylinderSpec | BoxSpec) -> tuple[Part, ...]:
    """Return the footprint of an obstacle in frame B, whose origin is the middle of the base."""
    if isinstance(spec, CylinderSpec):
        return (Part.disc(0.0, 0.0, spec.radius_m),)
    return (Part(obstacle_outline(spec).round(DECIMALS)),)
