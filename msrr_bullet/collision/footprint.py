"""The shadow of a body on the floor, as a few convex parts.

Everything here stands on the floor and moves in the plane, so two bodies are as far apart as their shadows:
what overhangs counts as if it reached the ground, which errs on the safe side only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from msrr_scenes.arrays import Array
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.solid import Solid
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.specs.bodies import BoxSpec, CylinderSpec

#: Two parts become one when their common hull adds no point farther than this from the body [m].
MERGE_TOLERANCE = 1e-4
#: A part goes when the others cover its border up to this [m].
COVER_TOLERANCE = 1e-6
#: Step with which borders are sampled to decide that [m].
BORDER_STEP = 5e-4
#: Decimals to which vertices are rounded [m]: a micrometre, so that a corner given twice is one corner.
DECIMALS = 6


@dataclass(frozen=True, eq=False)
class Part:
    """A convex part of a footprint: a core polygon, grown by a radius.

    Attributes:
        core: Vertices, counter-clockwise, shape (N, 2) [m]; a disc has its centre for a core, N = 1.
        radius: [m].
    """

    core: Array
    radius: float = 0.0

    @classmethod
    def polygon(cls, points: ArrayLike) -> Part:
        """Return the convex hull of ``points``, shape (N, 2) [m], which must not lie on one line."""
        p = np.asarray(points, dtype=np.float64).round(DECIMALS)
        hull: Array = p[ConvexHull(p).vertices]
        return cls(hull)

    @classmethod
    def disc(cls, x: float, y: float, radius: float) -> Part:
        """Return a disc about ``(x, y)`` [m]."""
        return cls(np.array([[x, y]]), radius)

    @cached_property
    def centre(self) -> Array:
        """Middle of the core's bounding box, shape (2,) [m]."""
        middle: Array = 0.5 * (self.core.min(axis=0) + self.core.max(axis=0))
        return middle

    @cached_property
    def circumradius(self) -> float:
        """Radius of a circle about :attr:`centre` that holds the part [m]."""
        return float(np.linalg.norm(self.core - self.centre, axis=1).max()) + self.radius

    def gap(self, points: ArrayLike) -> Array:
        """Return the distances [m], shape (N,), of ``points``, shape (N, 2), from the part; 0 inside."""
        p = np.asarray(points, dtype=np.float64)[:, None]
        a, b = self.core[None], np.roll(self.core, -1, axis=0)[None]
        edge, to_p = b - a, p - a
        length2 = np.maximum((edge**2).sum(axis=-1), np.finfo(float).tiny)
        t = np.clip((to_p * edge).sum(axis=-1) / length2, 0.0, 1.0)
        nearest = np.linalg.norm(to_p - t[..., None] * edge, axis=-1).min(axis=1)
        if len(self.core) > 2:
            inside = (edge[..., 0] * to_p[..., 1] - edge[..., 1] * to_p[..., 0] >= 0.0).all(axis=1)
            nearest = np.where(inside, 0.0, nearest)
        gap: Array = np.maximum(nearest - self.radius, 0.0)
        return gap

    def border(self) -> Array:
        """Return points on the part's border, no farther apart than :data:`BORDER_STEP`, shape (N, 2) [m]."""
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


def _gap_to_union(points: Array, parts: Sequence[Part]) -> Array:
    gaps: Array = np.min([part.gap(points) for part in parts], axis=0)
    return gaps


def _shadow(solid: Solid) -> Part:
    upright = abs(float(solid.X_UG.R[2, 2])) > 1.0 - 1e-12
    if solid.kind == "sphere" or (solid.kind == "cylinder" and upright):
        return Part.disc(float(solid.X_UG.p[0]), float(solid.X_UG.p[1]), solid.size[0])
    return Part.polygon(solid.outline())


def _common_hull(a: Part, b: Part, body: Sequence[Part]) -> Part | None:
    """Return the hull of two polygons, or None when it leaves the body."""
    hull = Part.polygon(np.concatenate([a.core, b.core]))
    # The middles of the edges settle nearly every case, at a small part of the cost.
    middles = 0.5 * (hull.core + np.roll(hull.core, -1, axis=0))
    for points in (middles, hull.border()):
        if _gap_to_union(points, body).max() > MERGE_TOLERANCE:
            return None
    return hull


def _join_one_pair(kept: Sequence[Part], body: Sequence[Part]) -> list[Part] | None:
    for a, b in combinations([p for p in kept if p.radius == 0.0], 2):
        if (hull := _common_hull(a, b, body)) is not None:
            return [p for p in kept if p is not a and p is not b] + [hull]
    return None


def _without_covered(parts: Sequence[Part], one_suffices: bool) -> list[Part]:
    """Drop the parts, smallest first, that lie in a single other one, or in the union of all the others."""
    kept = list(parts)
    for part in sorted(parts, key=lambda p: p.circumradius):
        others = [p for p in kept if p is not part]
        points = part.core if one_suffices and part.radius == 0.0 else part.border()
        groups = [[p] for p in others] if one_suffices else [others] if others else []
        if any(_gap_to_union(points, group).max() <= COVER_TOLERANCE for group in groups):
            kept = others
    return kept


def simplify(parts: Sequence[Part]) -> tuple[Part, ...]:
    """Return fewer parts with the same union, up to :data:`MERGE_TOLERANCE` outwards.

    Polygons are joined while the border of their common hull stays on the body; covered parts go.
    A hole that the parts enclose may be filled: nothing outside can be nearest to its rim.
    """
    body = kept = _without_covered(parts, one_suffices=True)
    while (fewer := _join_one_pair(kept, body)) is not None:
        kept = _without_covered(fewer, one_suffices=True)
    return tuple(_without_covered(kept, one_suffices=False))


@lru_cache(maxsize=32)
def unit_parts(geometry: UnitGeometry) -> tuple[Part, ...]:
    """Return the footprint of a unit in U: the pins of its front port stick out of it as they do in reality.

    Raises:
        GeometryError: The unit has no collision shape.
    """
    if not geometry.solids:
        raise GeometryError(f"{geometry.urdf}: no collision shapes, so it can keep no clearance")
    return simplify([_shadow(solid) for solid in geometry.solids])


def obstacle_parts(spec: CylinderSpec | BoxSpec) -> tuple[Part, ...]:
    """Return the footprint of an obstacle in its own frame, the middle of its base."""
    if isinstance(spec, CylinderSpec):
        return (Part.disc(0.0, 0.0, spec.radius_m),)
    x, y = 0.5 * spec.length_m, 0.5 * spec.width_m
    return (Part.polygon([[-x, -y], [x, -y], [x, y], [-x, y]]),)
