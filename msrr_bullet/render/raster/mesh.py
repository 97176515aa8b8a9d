"""A triangle mesh, and the primitive shapes as meshes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from msrr_bullet.render.raster.kernels.records import Indices
from msrr_scenes.arrays import Array

#: Largest gap between the chords of a round body and its circle [m].
_SAG = 1e-4


def segments(radius: float) -> int:
    """Return the number of chords for a circle [m]: a multiple of 4, so that the body keeps its width."""
    quarter = 0.5 * math.pi / math.acos(max(1.0 - _SAG / radius, 0.9))
    return 4 * min(math.ceil(0.5 * quarter), 32)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, counter-clockwise when seen from outside.

    Attributes:
        vertices: Shape (V, 3) [m].
        triangles: Vertex indices, shape (T, 3).
        normals: Unit normals for shading at each triangle's corners, shape (T, 3, 3); None: each triangle is
            flat.
        uv: Texture coordinates at each triangle's corners, shape (T, 3, 2), v upwards; None: no texture.
    """

    vertices: Array
    triangles: Indices
    normals: Array | None = None
    uv: Array | None = None

    def scaled(self, scale: Array) -> Mesh:
        """Return the mesh stretched by ``scale``, shape (3,); a mirrored mesh still faces outwards."""
        triangles, normals, uv = self.triangles, self.normals, self.uv
        if normals is not None:
            normals = normals / scale
            normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
        if np.prod(scale) < 0.0:
            triangles = triangles[:, ::-1]
            normals = None if normals is None else normals[:, ::-1]
            uv = None if uv is None else uv[:, ::-1]
        return Mesh(self.vertices * scale, triangles, normals, uv)


def box(size: Array) -> Mesh:
    """Return a box with full edges ``size``, shape (3,) [m], centred in the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return Mesh(corners * size, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def cylinder(radius: float, length: float) -> Mesh:
    """Return a cylinder [m] about z, centred in the origin, its side shaded as round."""
    return _revolved([(radius, -0.5 * length), (radius, 0.5 * length)], [0.0, 0.0], capped=True)


def sphere(radius: float) -> Mesh:
    """Return a sphere [m] about the origin, shaded as round."""
    latitudes = np.linspace(-0.5 * math.pi, 0.5 * math.pi, segments(radius) // 2 + 1)
    return _revolved([(radius * math.cos(a), radius * math.sin(a)) for a in latitudes], latitudes)


def capsule(radius: float, length: float) -> Mesh:
    """Return a capsule [m] about z, centred in the origin; ``length`` is that of its straight part."""
    quarter = np.linspace(0.0, 0.5 * math.pi, segments(radius) // 4 + 1)
    latitudes = np.concatenate([-quarter[::-1], quarter])
    profile = [
        (radius * math.cos(a), radius * math.sin(a) + math.copysign(0.5 * length, i - len(quarter) + 0.5))
        for i, a in enumerate(latitudes)
    ]
    return _revolved(profile, latitudes)


def _revolved(profile: list[tuple[float, float]], slopes: Any, capped: bool = False) -> Mesh:
    """Return the solid of revolution about z of a profile of (radius, z) [m], lowest point first.

    ``slopes`` are the elevations of the shading normals at these points [rad]. Flat discs close the ends of
    one that is ``capped``.
    """
    n = segments(max(radius for radius, _ in profile))
    profile = [(radius if radius > 1e-12 else 0.0, z) for radius, z in profile]  # a pole is one point
    turns = np.arange(n) * (2.0 * math.pi / n)
    c, s = np.cos(turns), np.sin(turns)
    vertices = np.concatenate([np.stack([r * c, r * s, np.full(n, z)], axis=1) for r, z in profile])
    rings = [np.stack([math.cos(a) * c, math.cos(a) * s, np.full(n, math.sin(a))], axis=1) for a in slopes]
    directions = np.concatenate(rings)
    i, j = np.arange(n), (np.arange(n) + 1) % n
    triangles = []
    for ring in range(len(profile) - 1):
        low, high = ring * n, (ring + 1) * n
        if profile[ring][0] > 0.0:
            triangles.append(np.stack([low + i, low + j, high + j], axis=1))
        if profile[ring + 1][0] > 0.0:
            triangles.append(np.stack([low + i, high + j, high + i], axis=1))
    side = np.concatenate(triangles)
    normals = directions[side]
    if not capped:
        return Mesh(vertices, side, normals)
    fan = np.stack([np.zeros(n - 2, dtype=np.int64), i[1:-1], i[2:]], axis=1)
    bottom, top = fan[:, ::-1], fan + (len(profile) - 1) * n
    up = np.broadcast_to([0.0, 0.0, 1.0], (n - 2, 3, 3))
    return Mesh(vertices, np.concatenate([side, bottom, top]), np.concatenate([normals, -up, up]))
