"""An exact distance of convex parts in the plane, and random parts and poses."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import ConvexHull

from msrr_bullet.collision.footprint import Part
from msrr_scenes.geometry.se2 import SE2


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def exact_distance(p, q, r):
    """Return the signed distance of two convex polygons or points, less r, and the vector from p to q.

    It is the distance of the origin from the polygon of all differences q - p.
    """
    differences = (q[:, None] - p[None]).reshape(-1, 2)
    hull = differences if len(differences) == 1 else differences[ConvexHull(differences).vertices]
    a, b = hull, np.roll(hull, -1, axis=0)
    edge = b - a
    length2 = np.maximum((edge**2).sum(axis=1), 1e-300)
    t = np.clip(-(a * edge).sum(axis=1) / length2, 0.0, 1.0)
    nearest = a + t[:, None] * edge
    distances = np.linalg.norm(nearest, axis=1)
    k = int(np.argmin(distances))
    inside = len(hull) > 2 and bool((cross(edge, -a) >= 0.0).all())
    return (-distances[k] if inside else distances[k]) - r, nearest[k]


def random_polygon(rng):
    n = int(rng.integers(3, 12))
    return Part.polygon(rng.normal(size=(n, 2)) * rng.uniform(0.01, 0.3, size=2) + rng.normal(size=2) * 0.1)


def random_pose(rng, spread=0.8):
    return SE2(*(spread * rng.normal(size=2)), rng.uniform(-math.pi, math.pi))
