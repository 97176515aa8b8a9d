"""How far two convex parts of footprints are apart, and where: nearest points from FCL.

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
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import fcl
import numpy as np

from msrr_bullet.collision.clearance import Point
from msrr_bullet.collision.footprint import Part
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2

#: Half the height of every spindle [m]. Any value serves: the distance does not depend on it.
SPINDLE_HEIGHT = 1.0
#: Radius of the sphere that stands for a point [m].
POINT_RADIUS = 1e-9
#: Below this distance [m] the nearest points are too close together to tell the direction between them.
TOUCHING = 1e-9
#: How much wider than the gap between two supporting lines a distance may be and still be believed [m].
CERTAIN = 1e-6
#: What bounds from circles give away [m], so that neither rounding nor a sphere that stands for a point makes
#: one larger than the distance that is measured.
ROUNDING = 1e-8


def _spindle(core: Array) -> fcl.CollisionGeometry:
    if len(core) == 1:
        return fcl.Sphere(POINT_RADIUS)
    n = len(core)
    apexes = [[*core.mean(axis=0), z] for z in (SPINDLE_HEIGHT, -SPINDLE_HEIGHT)]
    faces = [[3, i, (i + 1) % n, n] for i in range(n)] + [[3, (i + 1) % n, i, n + 1] for i in range(n)]
    vertices = np.concatenate([np.column_stack([core, np.zeros(n)]), apexes])
    return fcl.Convex(vertices, len(faces), np.concatenate(faces))


class PlacedPart:
    """One part of a body at the body's present pose; its FCL object follows when it is measured."""

    def __init__(self, part: Part) -> None:
        """Stand at the origin."""
        self.part = part
        self.radius = part.radius
        self.circumradius = part.circumradius
        # Two or eight points: plain floats are faster than arrays.
        self._core: list[list[float]] = part.core.tolist()
        self.middle: list[float] = part.centre.tolist()
        # A sphere lies about its own origin, so a disc's centre goes into the placement instead.
        self._offset = self._core[0] if len(self._core) == 1 else [0.0, 0.0]
        self._object = fcl.CollisionObject(_spindle(part.core), fcl.Transform())
        self._left_behind = False
        self.place(SE2(), 1.0, 0.0)

    def place(self, X_WB: SE2, c: float, s: float) -> None:
        """Move to a pose whose heading has the cosine ``c`` and the sine ``s``."""
        mx, my = self.middle
        self.x, self.y = X_WB.x + c * mx - s * my, X_WB.y + s * mx + c * my
        self._pose, self._c, self._s = X_WB, c, s
        self._left_behind = True

    @property
    def object(self) -> fcl.CollisionObject:
        """The FCL object, at the present pose."""
        if self._left_behind:
            X, c, s = self._pose, self._c, self._s
            ox, oy = self._offset
            rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            place = np.array([X.x + c * ox - s * oy, X.y + s * ox + c * oy, 0.0])
            self._object.setTransform(fcl.Transform(rotation, place))
            self._left_behind = False
        return self._object

    def core(self) -> Array:
        """Return the core's vertices in W, shape (N, 2) [m]."""
        return self._pose.act(self.part.core)

    def corners(self) -> list[Point]:
        """Return the same as points."""
        X, c, s = self._pose, self._c, self._s
        return [(X.x + c * x - s * y, X.y + s * x + c * y) for x, y in self._core]

    def front(self, nx: float, ny: float) -> float:
        """Return how far the core reaches along a direction of W, from W's origin [m]."""
        c, s = self._c, self._s
        bx, by = c * nx + s * ny, c * ny - s * nx
        return self._pose.x * nx + self._pose.y * ny + max([x * bx + y * by for x, y in self._core])


class Gap(NamedTuple):
    """The distance between two parts.

    Attributes:
        distance: [m]; 0 or less where they touch: minus the way that would part them.
        point_a: The nearest point of one part in W [m]; in an overlap, its deepest one.
        point_b: The nearest point of the other in W [m].
    """

    distance: float
    point_a: Point
    point_b: Point


class PartPair:
    """Two parts of two bodies, and the direction in which they were apart when last measured.

    Whatever has moved since, they are at least as far apart as that direction tells: no measurement is needed
    to know that they cannot be the nearest.
    """

    def __init__(self, a: PlacedPart, b: PlacedPart) -> None:
        """Begin with nothing measured."""
        self._a, self._b = a, b
        self._reach = a.circumradius + b.circumradius + ROUNDING
        self._direction: Point | None = None

    def circles_apart(self) -> float:
        """Return a distance [m] that the two parts have at least, from the circles about them."""
        return math.hypot(self._a.x - self._b.x, self._a.y - self._b.y) - self._reach

    def farther_than(self, distance: float) -> bool:
        """Say whether the two parts are surely farther apart than ``distance`` [m]; False where in doubt."""
        if self.circles_apart() > distance:
            return True
        if self._direction is None:
            return False
        a, b, (nx, ny) = self._a, self._b, self._direction
        return -b.front(-nx, -ny) - a.front(nx, ny) - a.radius - b.radius - ROUNDING > distance

    def measure(self) -> Gap:
        """Return how far apart they are."""
        a, b = self._a, self._b
        result = fcl.DistanceResult()
        distance = fcl.distance(a.object, b.object, fcl.DistanceRequest(enable_nearest_points=True), result)
        if distance > TOUCHING:
            (ax, ay, _), (bx, by, _) = (p.tolist() for p in result.nearest_points)
            nx, ny = (bx - ax) / distance, (by - ay) / distance
            # FCL's search ends early where two shapes face each other to within micrometres, up to 95 mm too
            # far apart. The cores are as far apart as found if no point of either lies in between.
            if -b.front(-nx, -ny) - a.front(nx, ny) < distance - CERTAIN:
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
    """Return two cores' overlap [m], the direction from ``p`` to ``q`` and their deepest points, in W."""
    best: tuple[float, float, float] | None = None
    for own, other, sign in ((p, q, 1.0), (q, p, -1.0)):
        for (x, y), (x_next, y_next) in pairwise((*own, own[0])):
            ex, ey = x_next - x, y_next - y
            length = math.sqrt(ex * ex + ey * ey)
            if length == 0.0:  # a point has no edges
                continue
            nx, ny = ey / length, -ex / length  # outwards: the edge's own side reaches farthest along it
            depth = nx * x + ny * y - min([nx * u + ny * v for u, v in other])
            if best is None or depth < best[0]:
                best = (depth, sign * nx, sign * ny)
    if best is None:  # two centres in one place: every direction is as good
        return 0.0, (1.0, 0.0), p[0], q[0]
    depth, nx, ny = best
    # Each core is deepest in a vertex or along an edge; the points lie face to face where the two overlap.
    front, back = max([nx * x + ny * y for x, y in p]), min([nx * x + ny * y for x, y in q])
    along_p = [nx * y - ny * x for x, y in p if nx * x + ny * y >= front - TOUCHING]
    along_q = [nx * y - ny * x for x, y in q if nx * x + ny * y <= back + TOUCHING]
    middle = 0.5 * (max(min(along_p), min(along_q)) + min(max(along_p), max(along_q)))
    deepest_p = (front * nx - middle * ny, front * ny + middle * nx)
    return front - back, (nx, ny), deepest_p, (back * nx - middle * ny, back * ny + middle * nx)


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
