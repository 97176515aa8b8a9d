"""Faces that no camera can see, because another solid of the same moving frame encloses them."""

from __future__ import annotations

import numpy as np

from msrr_bullet.render.raster.kernels.compiler import inlined, kernel, subroutine
from msrr_bullet.render.raster.kernels.records import Geometry
from msrr_scenes.arrays import Array

#: Solids that touch may be apart by this much, by rounding of what a URDF says [m].
_FLUSH = 1e-7

#: Largest component of the sum of the area vectors of a closed solid [m2].
_CLOSED = 1e-9


@kernel
def turn_enclosed_faces(geometry: Geometry, planes: Array) -> None:
    """Turn faces that lie in or on another convex solid of their moving frame away from every camera.

    Only a camera inside that solid could see them. A face flush with a face of the solid that looks the same
    way is still seen.

    Args:
        geometry: All faces.
        planes: A copy of their planes, in which the offset of an enclosed face becomes infinite.
    """
    for s in range(len(geometry.shape_frame)):
        if not is_convex_solid(geometry, s):
            continue
        x, y, z, radius = geometry.shape_ball[s]
        for t in range(len(geometry.shape_frame)):
            if t == s or geometry.shape_frame[t] != geometry.shape_frame[s]:
                continue
            ball = geometry.shape_ball[t]
            away = np.sqrt((ball[0] - x) ** 2 + (ball[1] - y) ** 2 + (ball[2] - z) ** 2)
            if away <= radius + ball[3] + _FLUSH:
                for face in range(geometry.shape_face[t], geometry.shape_face[t + 1]):
                    if encloses(geometry, s, face):
                        planes[face, 3] = np.inf


@inlined
def height_above(planes: Array, face: int, p: Array) -> float:
    """Return how far a point is in front of the plane of a face [m]."""
    return planes[face, 0] * p[0] + planes[face, 1] * p[1] + planes[face, 2] * p[2] - planes[face, 3]


@subroutine
def is_convex_solid(geometry: Geometry, s: int) -> bool:
    """Say whether shape s is closed and convex; the area vectors of a closed one sum to nothing."""
    total = np.zeros(3)
    for face in range(geometry.shape_face[s], geometry.shape_face[s + 1]):
        first, end = geometry.corner_start[face], geometry.corner_start[face + 1]
        a = geometry.vertices[geometry.corners[end - 1]]
        for i in range(first, end):
            b = geometry.vertices[geometry.corners[i]]
            total[0] += a[1] * b[2] - a[2] * b[1]
            total[1] += a[2] * b[0] - a[0] * b[2]
            total[2] += a[0] * b[1] - a[1] * b[0]
            a = b
        for i in range(geometry.shape_vertex[s], geometry.shape_vertex[s + 1]):
            if height_above(geometry.planes, face, geometry.vertices[i]) > _FLUSH:
                return False
    return max(abs(total[0]), abs(total[1]), abs(total[2])) < _CLOSED


@subroutine
def encloses(geometry: Geometry, s: int, face: int) -> bool:
    """Say whether a face lies in or on the convex solid s, and not flush with a face that looks its way."""
    planes = geometry.planes
    for side in range(geometry.shape_face[s], geometry.shape_face[s + 1]):
        flush = True
        for i in range(geometry.corner_start[face], geometry.corner_start[face + 1]):
            height = height_above(planes, side, geometry.vertices[geometry.corners[i]])
            if height > _FLUSH:
                return False
            flush &= height > -_FLUSH
        alike = planes[side, 0] * planes[face, 0] + planes[side, 1] * planes[face, 1]
        if flush and alike + planes[side, 2] * planes[face, 2] > 0.0:
            return False
    return True
