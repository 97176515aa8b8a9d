"""How far the bodies are apart, and where: nearest points from FCL.

FCL measures in space, and its distance between upright prisms is not to be trusted: where two vertical
edges are nearest every height is as good, and the search may end with points at different heights,
decimetres too far apart (often with prisms of different heights, now and then with prisms of one height).
So every convex part of a footprint becomes a spindle: widest at height 0, where it has the part's outline,
pointed above and below. Two spindles are nearest, and meet first, at height 0 alone, and their distance is
that of the outlines. A disc is handed over as its centre and its radius subtracted here, for on curved
shapes the search is inexact too. Where two parts overlap FCL gives no distance; the depth is then found on
the separating axes of the polygons (Ericson, Real-Time Collision Detection, 2005, section 5.2).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import fcl
import numpy as np
from numpy.typing import NDArray

from msrr_bullet.footprint import Part, obstacle_parts, unit_parts
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.scene import Scene
from msrr_scenes.se2 import SE2

Array = NDArray[np.float64]
Pair = frozenset[str]
Point = tuple[float, float]

#: Half the height of every spindle [m]. Any value serves: the distance does not depend on it.
SPINDLE_HEIGHT = 1.0
#: Radius of the sphere that stands for a point [m].
POINT_RADIUS = 1e-9
#: Below this distance [m] the nearest points are too close together to tell the direction between them.
TOUCHING = 1e-9
#: How much wider than the gap between two supporting lines a distance may be and still be believed [m].
CERTAIN = 1e-6


@dataclass(frozen=True, slots=True)
class Clearance:
    """The distance between two bodies.

    Attributes:
        distance: [m]; 0 or less where they touch: minus the way that would part the deepest pair of parts.
        body_a: Name of one body.
        body_b: Name of the other.
        point_a: The nearest point of ``body_a`` in W [m]; in an overlap, its deepest one.
        point_b: The nearest point of ``body_b`` in W [m].
    """

    distance: float
    body_a: str
    body_b: str
    point_a: Point
    point_b: Point

    @property
    def pair(self) -> Pair:
        """The two names, in no order."""
        return frozenset((self.body_a, self.body_b))


def _spindle(core: Array) -> fcl.CollisionGeometry:
    if len(core) == 1:
        return fcl.Sphere(POINT_RADIUS)
    n = len(core)
    apexes = [[*core.mean(axis=0), z] for z in (SPINDLE_HEIGHT, -SPINDLE_HEIGHT)]
    faces = [[3, i, (i + 1) % n, n] for i in range(n)] + [[3, (i + 1) % n, i, n + 1] for i in range(n)]
    vertices = np.concatenate([np.column_stack([core, np.zeros(n)]), apexes])
    return fcl.Convex(vertices, len(faces), np.concatenate(faces))


class _PlacedPart:
    """One part of a body with its FCL object, at the body's present pose."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.radius = part.radius
        self.circumradius = part.circumradius
        # A sphere lies about its own origin, so a disc's centre goes into the placement instead.
        self._offset = part.core[0] if len(part.core) == 1 else np.zeros(2)
        self.object = fcl.CollisionObject(_spindle(part.core), fcl.Transform())
        self.centre = (0.0, 0.0)
        self.pose = SE2()

    def place(self, X_WB: SE2) -> None:
        c, s = math.cos(X_WB.yaw), math.sin(X_WB.yaw)
        ox, oy = self._offset
        self.object.setTransform(
            fcl.Transform(
                np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
                np.array([X_WB.x + c * ox - s * oy, X_WB.y + s * ox + c * oy, 0.0]),
            )
        )
        mx, my = self.part.centre
        self.centre = (X_WB.x + c * mx - s * my, X_WB.y + s * mx + c * my)
        self.pose = X_WB

    def bound(self, other: _PlacedPart) -> float:
        """Return a distance [m] that the two parts have at least, from the circles about them."""
        apart = math.hypot(self.centre[0] - other.centre[0], self.centre[1] - other.centre[1])
        return apart - self.circumradius - other.circumradius


class _Body:
    """A body's parts, moved together."""

    def __init__(self, name: str, parts: Sequence[Part]) -> None:
        self.name = name
        self.parts = tuple(_PlacedPart(part) for part in parts)
        self._pose: SE2 | None = None

    def place(self, X_WB: SE2) -> None:
        if self._pose != X_WB:
            for part in self.parts:
                part.place(X_WB)
            self._pose = X_WB


def _overlap(a: _PlacedPart, b: _PlacedPart) -> tuple[float, Array, Array, Array]:
    """Return two cores' overlap [m], the direction (2,) from a to b, and their deepest points (2,) in W."""
    p, q = a.pose.act(a.part.core), b.pose.act(b.part.core)
    axes = [np.empty((0, 2))]
    for core, sign in ((p, 1.0), (q, -1.0)):
        if len(core) > 1:
            edge = np.roll(core, -1, axis=0) - core
            normal = np.column_stack([edge[:, 1], -edge[:, 0]])
            axes.append(sign * normal / np.linalg.norm(normal, axis=1, keepdims=True))
    n = np.concatenate(axes)
    if not len(n):  # two centres in one place: every direction is as good
        return 0.0, np.array([1.0, 0.0]), p[0], q[0]
    best = int(np.argmin((p @ n.T).max(axis=0) - (q @ n.T).min(axis=0)))
    normal, tangent = n[best], np.array([-n[best, 1], n[best, 0]])
    front, back = float((p @ normal).max()), float((q @ normal).min())
    # Each core is deepest in a vertex or along an edge; the points lie face to face where the two overlap.
    deepest_a, deepest_b = p[p @ normal >= front - TOUCHING], q[q @ normal <= back + TOUCHING]
    along = np.array([[np.min(d @ tangent), np.max(d @ tangent)] for d in (deepest_a, deepest_b)])
    middle = 0.5 * (along[:, 0].max() + along[:, 1].min()) * tangent
    return front - back, normal, middle + front * normal, middle + back * normal


def _is_certain(p: Array, q: Array, distance: float, direction: Array) -> bool:
    """Say whether two cores (N, 2) in W are as far apart as found: no point of either lies in between.

    FCL's search ends early where two shapes face each other to within micrometres, up to 95 mm too far apart.
    """
    gap = float((q @ direction).min() - (p @ direction).max())
    return gap >= distance - CERTAIN


def _nearest_points(p: Array, q: Array) -> tuple[float, Array, Array]:
    """Return distance [m] and nearest points (2,) of two separate cores (N, 2): a vertex and an edge."""
    best = (math.inf, p[0], q[0])
    for vertices, polygon, swapped in ((p, q, False), (q, p, True)):
        edge = np.roll(polygon, -1, axis=0) - polygon
        to = vertices[:, None, :] - polygon[None, :, :]
        length2 = np.maximum((edge**2).sum(axis=1), TOUCHING**2)
        foot = polygon + np.clip((to * edge).sum(axis=2) / length2, 0.0, 1.0)[..., None] * edge
        apart = np.linalg.norm(vertices[:, None, :] - foot, axis=2)
        i, j = np.unravel_index(int(np.argmin(apart)), apart.shape)
        if apart[i, j] < best[0]:
            pair = (vertices[i], foot[i, j])
            best = (float(apart[i, j]), *(pair[::-1] if swapped else pair))
    return best


def _measure(a: _PlacedPart, b: _PlacedPart) -> tuple[float, Point, Point]:
    result = fcl.DistanceResult()
    distance = fcl.distance(a.object, b.object, fcl.DistanceRequest(enable_nearest_points=True), result)
    if distance > TOUCHING:
        core_a, core_b = (np.asarray(p[:2]) for p in result.nearest_points)
        direction = (core_b - core_a) / distance
        p, q = a.pose.act(a.part.core), b.pose.act(b.part.core)
        if not _is_certain(p, q, distance, direction):
            distance, core_a, core_b = _nearest_points(p, q)
            direction = (core_b - core_a) / distance
    else:
        depth, direction, core_a, core_b = _overlap(a, b)
        distance = -depth
    point_a, point_b = core_a + a.radius * direction, core_b - b.radius * direction
    return (
        float(distance) - a.radius - b.radius,
        (float(point_a[0]), float(point_a[1])),
        (float(point_b[0]), float(point_b[1])),
    )


class ClearanceModel:
    """The shapes of a scene, ready to be placed and measured.

    Two obstacles are never measured against each other: neither moves.
    """

    def __init__(self, scene: Scene) -> None:
        """Take the units' shapes from their URDFs and the obstacles' from the scene."""
        footprints = {name: unit_parts(scene.geometry(name)) for name in scene.units}
        footprints |= {name: obstacle_parts(spec) for name, spec in scene.obstacles.items()}
        self._build(footprints, scene.obstacles)

    @classmethod
    def from_footprints(
        cls, footprints: Mapping[str, Sequence[Part]], fixed: Collection[str] = ()
    ) -> ClearanceModel:
        """Build from footprints by name; the ``fixed`` ones are not measured against each other."""
        model = cls.__new__(cls)
        model._build(footprints, fixed)
        return model

    def _build(self, footprints: Mapping[str, Sequence[Part]], fixed: Collection[str]) -> None:
        self._bodies = {name: _Body(name, parts) for name, parts in footprints.items()}
        self._fixed = frozenset(fixed)

    def query(
        self, poses: Mapping[str, SE2], exempt: Collection[Pair] = frozenset()
    ) -> tuple[Clearance, ...]:
        """Return the clearance of every pair of bodies, nearest first.

        Args:
            poses: ``X_WB`` by name: frame U of a unit, the middle of an obstacle. Bodies that are not named
                are not there (yet).
            exempt: Pairs to leave out, such as two units whose contact is authorised.

        Raises:
            UnknownNameError: A pose for a body that the scene does not have.
        """
        found = [self._between(a, b, math.inf) for a, b in self._pairs(poses, exempt)]
        return tuple(sorted((c for c in found if c is not None), key=lambda c: c.distance))

    def minimum(self, poses: Mapping[str, SE2], exempt: Collection[Pair] = frozenset()) -> Clearance | None:
        """Return the smallest clearance, or None when there is no pair; cheaper than all of :meth:`query`.

        Pairs are taken in the order of what the circles about them promise, until none can be nearer.
        """
        best: Clearance | None = None
        bounded = [
            (min(p.bound(q) for p in a.parts for q in b.parts), a, b) for a, b in self._pairs(poses, exempt)
        ]
        for bound, a, b in sorted(bounded, key=lambda entry: entry[0]):
            if best is not None and bound >= best.distance:
                break
            best = self._between(a, b, best.distance if best else math.inf) or best
        return best

    def _pairs(self, poses: Mapping[str, SE2], exempt: Collection[Pair]) -> Iterator[tuple[_Body, _Body]]:
        present = []
        for name, X_WB in poses.items():
            if name not in self._bodies:
                raise UnknownNameError("body", name, self._bodies)
            self._bodies[name].place(X_WB)
            present.append(name)
        for a, b in combinations(present, 2):
            if not ({a, b} <= self._fixed or frozenset((a, b)) in exempt):
                yield self._bodies[a], self._bodies[b]

    @staticmethod
    def _between(a: _Body, b: _Body, below: float) -> Clearance | None:
        """Return the clearance of two placed bodies, or None when it is not below ``below`` [m]."""
        best: Clearance | None = None
        bounded = [(p.bound(q), p, q) for p in a.parts for q in b.parts]
        for bound, p, q in sorted(bounded, key=lambda entry: entry[0]):
            if bound >= below:
                break
            distance, point_a, point_b = _measure(p, q)
            if distance < below:
                below = distance
                best = Clearance(distance, a.name, b.name, point_a, point_b)
        return best
