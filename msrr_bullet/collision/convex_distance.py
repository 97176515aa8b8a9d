"""Distance and nearest points of two convex parts of footprints, from FCL.

FCL measures in space, and its distance between upright prisms is not reliable: where two vertical edges are
nearest, every height is equally good, and the search may end with points at different heights, decimetres too
far apart (often with prisms of different heights, sometimes with prisms of equal height). Therefore every
convex part becomes a spindle: widest at height 0, where it has the outline of the part, pointed above and
below. Two spindles are nearest at height 0 alone, and their distance is that of the outlines. A disc becomes
a point, and its radius is subtracted here, because the search is inexact on curved shapes too. Where two
parts overlap FCL gives no distance; the penetration depth is then found on the separating axes of the
polygons (Ericson, Real-Time Collision Detection, 2005, section 5.2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import fcl
import numpy as np

from msrr_bullet.collision.clearance import Point
from msrr_bullet.collision.footprint import Part
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2

#: Half the height of every spindle [m]; the distance does not depend on it.
SPINDLE_HEIGHT = 1.0
#: Radius of the sphere that represents a point [m].
POINT_RADIUS = 1e-9
#: Below this distance [m] the nearest points are too close together to tell the direction between them.
TOUCHING = 1e-9
#: Largest difference between a distance of FCL and the gap between the supporting lines [m].
SUPPORT_TOLERANCE = 1e-6
#: Margin of lower bounds [m], so that neither rounding nor the spheres that represent points make a bound
#: larger than the measured distance.
ROUNDING = 1e-8

_WITH_POINTS = fcl.DistanceRequest(enable_nearest_points=True)


def _spindle(core: Array) -> fcl.CollisionGeometry:
    if len(core) == 1:
        return fcl.Sphere(POINT_RADIUS)
    n = len(core)
    apexes = [[*core.mean(axis=0), z] for z in (SPINDLE_HEIGHT, -SPINDLE_HEIGHT)]
    faces = [[3, i, (i + 1) % n, n] for i in range(n)] + [[3, (i + 1) % n, i, n + 1] for i in range(n)]
    vertices = np.concatenate([np.column_stack([core, np.zeros(n)]), apexes])
    return fcl.Convex(vertices, len(faces), np.concatenate(faces))


class PlacedPart:
    """A part of a body at the present pose of the body; the FCL object is moved only when it is measured."""

    def __init__(self, part: Part) -> None:
        """Place the part with the body frame at the origin of W."""
        self.part = part
        self.radius = part.radius
        self.circumradius = part.circumradius
        # Plain floats are faster than arrays for so few points.
        self._core: list[list[float]] = part.core.tolist()
        self.centre: list[float] = part.centre.tolist()
        # The centre of an FCL sphere is its origin, so the centre of a disc is part of the transform.
        self._offset = self._core[0] if len(self._core) == 1 else [0.0, 0.0]
        self._object = fcl.CollisionObject(_spindle(part.core), fcl.Transform())
        self._rotation, self._position = np.eye(3), np.zeros(3)
        self._outdated = False
        self.place(SE2(), 1.0, 0.0)

    def place(self, X_WB: SE2, c: float, s: float) -> None:
        """Move the body to a pose whose heading has the cosine ``c`` and the sine ``s``."""
        mx, my = self.centre
        self.x, self.y = X_WB.x + c * mx - s * my, X_WB.y + s * mx + c * my
        self._pose, self._c, self._s = X_WB, c, s
        self._outdated = True

    @property
    def object(self) -> fcl.CollisionObject:
        """The FCL object at the present pose."""
        if self._outdated:
            X, c, s = self._pose, self._c, self._s
            ox, oy = self._offset
            R, p = self._rotation, self._position
            R[0, 0], R[0, 1], R[1, 0], R[1, 1] = c, -s, s, c
            p[0], p[1] = X.x + c * ox - s * oy, X.y + s * ox + c * oy
            self._object.setTransform(fcl.Transform(R, p))
            self._outdated = False
        return self._object

    def core(self) -> Array:
        """Return the vertices of the core in W [m], shape (N, 2)."""
        return self._pose.act(self.part.core)

    def corners(self) -> list[Point]:
        """Return the vertices of the core in W [m] as a list of points."""
        X, c, s = self._pose, self._c, self._s
        return [(X.x + c * x - s * y, X.y + s * x + c * y) for x, y in self._core]

    def support(self, nx: float, ny: float) -> float:
        """Return the largest coordinate of the core along a unit vector of W, from the origin of W [m]."""
        c, s = self._c, self._s
        bx, by = c * nx + s * ny, c * ny - s * nx
        return self._pose.x * nx + self._pose.y * ny + max([x * bx + y * by for x, y in self._core])


class Gap(NamedTuple):
    """The distance between two parts.

    All is as in :class:`msrr_bullet.collision.clearance.Clearance`.
    """

    distance: float
    point_a: Point
    point_b: Point


class PartPair:
    """Two parts of two bodies, and the direction of their distance when they were last measured.

    The gap of the two parts along that direction is a lower bound of their distance at any later pose.
    """

    def __init__(self, a: PlacedPart, b: PlacedPart) -> None:
        """Start without a measured direction."""
        self._a, self._b = a, b
        self._reach = a.circumradius + b.circumradius + ROUNDING
        self._direction: Point | None = None

    def circle_distance(self) -> float:
        """Return a lower bound of the distance of the two parts [m], from circles about them."""
        return math.hypot(self._a.x - self._b.x, self._a.y - self._b.y) - self._reach

    def farther_than(self, distance: float) -> bool:
        """Return whether a lower bound exceeds ``distance`` [m]; False does not mean that they are nearer."""
        if self.circle_distance() > distance:
            return True
        if self._direction is None:
            return False
        a, b, (nx, ny) = self._a, self._b, self._direction
        return -b.support(-nx, -ny) - a.support(nx, ny) - a.radius - b.radius - ROUNDING > distance

    def measure(self) -> Gap:
        """Return the distance and the nearest points."""
        a, b = self._a, self._b
        result = fcl.DistanceResult()
        distance = fcl.distance(a.object, b.object, _WITH_POINTS, result)
        if distance > TOUCHING:
            (ax, ay, _), (bx, by, _) = (p.tolist() for p in result.nearest_points)
            nx, ny = (bx - ax) / distance, (by - ay) / distance
            # The search of FCL ends early where two shapes face each other to within micrometres, with a
            # distance up to 95 mm too large. It is right if no point of either core lies in between.
            if -b.support(-nx, -ny) - a.support(nx, ny) < distance - SUPPORT_TOLERANCE:
                distance, core_a, core_b = _nearest_points(a.core(), b.core())
                (ax, ay), (bx, by) = core_a.tolist(), core_b.tolist()
                nx, ny = (bx - ax) / distance, (by - ay) / distance
        else:
            depth, (nx, ny), (ax, ay), (bx, by) = _overlap(a.corners(), b.corners())
            distance = -depth

        self._direction = (nx, ny)
        return Gap(
            float(distance) - a.radius - b.radius,
            (ax + a.radius * nx, ay + a.radius * ny),
            (bx - b.radius * nx, by - b.radius * ny),
        )


def _overlap(p: Sequence[Point], q: Sequence[Point]) -> tuple[float, Point, Point, Point]:
    """Return the penetration depth of two cores [m], the direction from p to q, and the deepest points."""
    best: tuple[float, float, float] | None = None
    for polygon, other, sign in ((p, q, 1.0), (q, p, -1.0)):
        for (x, y), (x_next, y_next) in pairwise((*polygon, polygon[0])):
            ex, ey = x_next - x, y_next - y
            length = math.sqrt(ex * ex + ey * ey)
            if length == 0.0:  # a point has no edges
                continue
            nx, ny = ey / length, -ex / length  # the outward normal of the edge
            depth = nx * x + ny * y - min([nx * u + ny * v for u, v in other])
            if best is None or depth < best[0]:
                best = (depth, sign * nx, sign * ny)
    if best is None:  # two coincident points: every direction is equally good
        return 0.0, (1.0, 0.0), p[0], q[0]
    depth, nx, ny = best
    # The deepest points of a core are a vertex or an edge; the middle of their common interval is taken.
    front, back = max([nx * x + ny * y for x, y in p]), min([nx * x + ny * y for x, y in q])
    along_p = [nx * y - ny * x for x, y in p if nx * x + ny * y >= front - TOUCHING]
    along_q = [nx * y - ny * x for x, y in q if nx * x + ny * y <= back + TOUCHING]
    middle = 0.5 * (max(min(along_p), min(along_q)) + min(max(along_p), max(along_q)))
    deepest_p = (front * nx - middle * ny, front * ny + middle * nx)
    return front - back, (nx, ny), deepest_p, (back * nx - middle * ny, back * ny + middle * nx)


def _nearest_points(p: Array, q: Array) -> tuple[float, Array, Array]:
    """Return the distance [m] and the nearest points, shape (2,), of two separate cores, shape (N, 2)."""
    best = (math.inf, p[0], q[0])
    for vertices, polygon, swapped in ((p, q, False), (q, p, True)):
        edge = np.roll(polygon, -1, axis=0) - polygon
        offset = vertices[:, None, :] - polygon[None, :, :]
        length2 = np.maximum((edge**2).sum(axis=1), TOUCHING**2)
        foot = polygon + np.clip((offset * edge).sum(axis=2) / length2, 0.0, 1.0)[..., None] * edge
        distance = np.linalg.norm(vertices[:, None, :] - foot, axis=2)
        i, j = np.unravel_index(int(np.argmin(distance)), distance.shape)
        if distance[i, j] < best[0]:
            pair = (vertices[i], foot[i, j])
            best = (float(distance[i, j]), *(pair[::-1] if swapped else pair))
    return best
