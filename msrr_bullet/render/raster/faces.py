"""Faces of a mesh: convex planar polygons, the unit of visibility.

A pixel whose corners all show one face needs no further samples, so every edge costs. Triangles that lie in
one plane and together are convex therefore become one face: a side of a box, the cap of a cylinder, the quad
of a tag.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.render.raster.kernels.records import Indices
from msrr_bullet.render.raster.mesh import Mesh
from msrr_scenes.arrays import Array

#: Triangles are coplanar when their unit normals differ by less than this number, and their offsets by less
#: than the number times the mesh's size.
_COPLANAR = 1e-7

#: A triangle is flat when the normals at its corners are this close to its own.
_FLAT = 1e-3

#: The largest polygon; the cost of a row grows with the number of edges.
_MOST_CORNERS = 128

#: Vertices around a polygon, counter-clockwise from outside.
_Outline = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class MeshFaces:
    """Convex planar polygons of one mesh. An affine function is (gx, gy, gz, g0): ``g . p + g0``.

    Attributes:
        vertices: Shape (V, 3) [m].
        start: First entry of each face in ``corners``, shape (F + 1,).
        corners: Vertex indices, counter-clockwise from outside.
        planes: Unit normal and offset, ``n . p = d``, shape (F, 4).
        smooth: Faces whose shading normals change over them, shape (F,).
        corner_normals: Shading normals at three of the corners, shape (F, 3, 3).
        weights: Affine functions that weigh the second and the third of these corners, shape (F, 2, 4).
        uv: Affine functions of the texture coordinates, shape (F, 2, 4); zero without texture.
        surface: Number of the round surface that a face is part of, from 0 up, or -1; shape (F,). Across an
            edge within a surface the shading goes on without a crease.
        across: Face of the same surface across the edge that ends at each corner, or -1; shape of
            ``corners``.
    """

    vertices: Array
    start: Indices
    corners: Indices
    planes: Array
    smooth: NDArray[np.bool_]
    corner_normals: Array
    weights: Array
    uv: Array
    surface: Indices
    across: Indices


def faces_of(mesh: Mesh) -> MeshFaces:
    """Return the faces of a mesh without the triangles that have no area.

    The faces of meshes with equal arrays are computed once: units are alike, and so are trials.
    """
    optional = (None if a is None else a.tobytes() for a in (mesh.normals, mesh.uv))
    return _faces(mesh.vertices.tobytes(), mesh.triangles.tobytes(), *optional)


@lru_cache(maxsize=1024)
def _faces(vertices: bytes, triangles: bytes, normals: bytes | None, uv: bytes | None) -> MeshFaces:
    """Return the faces of the mesh whose arrays have these bytes."""
    return _compute_faces(
        Mesh(
            np.frombuffer(vertices, np.float64).reshape(-1, 3),
            np.frombuffer(triangles, np.int64).reshape(-1, 3),
            None if normals is None else np.frombuffer(normals, np.float64).reshape(-1, 3, 3),
            None if uv is None else np.frombuffer(uv, np.float64).reshape(-1, 3, 2),
        )
    )


def _compute_faces(mesh: Mesh) -> MeshFaces:
    vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    triangles = index.reshape(-1)[mesh.triangles]
    p = vertices[triangles]  # (T, 3, 3)
    area = _cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(area, axis=1)
    extent = float(np.ptp(vertices, axis=0).max())
    keep = length > 1e-14 * extent * extent
    triangles, p = triangles[keep], p[keep]
    normal = area[keep] / length[keep, None]
    normals = np.repeat(normal[:, None], 3, axis=1) if mesh.normals is None else mesh.normals[keep]
    uv = np.zeros((len(p), 3, 2)) if mesh.uv is None else mesh.uv[keep]

    weights = _weights(p, normal)
    maps = _maps(uv, weights)
    smooth = np.abs(normals - normal[:, None]).max(axis=(1, 2)) > _FLAT
    offset = np.einsum("ta,ta->t", normal, p[:, 0])

    named = triangles.tobytes()
    pairs = _neighbours(named)
    planar = _coplanar(pairs, normal, offset, np.concatenate([maps, _maps(normals, weights)], axis=1), extent)
    groups = _outlined(named, planar.tobytes())
    convex = _are_convex(groups, vertices, normal)
    polygons: list[tuple[int, _Outline]] = []
    for i, (group, outline) in enumerate(groups):
        if outline is not None and i in convex:
            polygons.append((group[0], outline))
        else:
            polygons += [(t, tuple(triangles[t].tolist())) for t in group]
    of = np.array([t for t, _ in polygons], dtype=np.int64)
    start = np.cumsum([0, *(len(corners) for _, corners in polygons)])
    surface = _surfaces(pairs, normals, smooth)[of]
    return MeshFaces(
        vertices,
        start.astype(np.int64),
        np.array([v for _, corners in polygons for v in corners], dtype=np.int64),
        np.column_stack([normal[of], offset[of]]),
        smooth[of],
        normals[of],
        weights[of],
        maps[of],
        surface,
        _across(tuple(corners for _, corners in polygons), surface.tobytes()),
    )


def _weights(p: Array, normal: Array) -> Array:
    """Return the affine functions that are 1 at the second (third) corner and 0 at the others, (T, 2, 4)."""
    one, two = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    out = np.zeros((len(p), 2, 4))
    for k, (own, other) in enumerate(((one, two), (two, one))):
        gradient = _cross(normal, other)
        gradient = gradient / np.einsum("ta,ta->t", gradient, own)[:, None]
        out[:, k, :3] = gradient
        out[:, k, 3] = -np.einsum("ta,ta->t", gradient, p[:, 0])
    return out


def _maps(values: Array, weights: Array) -> Array:
    """Return the affine functions that take ``values``, (T, 3, k), at the corners; shape (T, k, 4)."""
    rise = np.stack([values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]], axis=1)
    maps: Array = np.einsum("tck,tca->tka", rise, weights)
    maps[..., 3] += values[:, 0]
    return maps


def _coplanar(pairs: Indices, normal: Array, offset: Array, maps: Array, extent: float) -> Indices:
    """Return the number of each triangle's group, which hangs together, lies in one plane, has equal maps.

    ``pairs`` are from :func:`_neighbours`. Normals have shape (T, 3), offsets (T,) [m], and affine maps
    (T, k, 4). ``extent`` is the size of the mesh [m].
    """
    t, other = pairs[:, :, 0].T
    joined = (
        (np.abs(normal[t] - normal[other]).max(axis=1) < _COPLANAR)
        & (np.abs(offset[t] - offset[other]) < _COPLANAR * extent)
        & (
            np.abs(maps[t] - maps[other]).max(axis=(1, 2))
            < _COPLANAR * (1.0 + np.abs(maps[t]).max(axis=(1, 2)))
        )
    )
    return _components(len(normal), t[joined].tobytes(), other[joined].tobytes())


def _surfaces(pairs: Indices, normals: Array, smooth: NDArray[np.bool_]) -> Indices:
    """Return the round surface of each triangle, or -1. In it, neighbours' normals agree along their edge."""
    (t, i), (other, j) = pairs[:, 0].T, pairs[:, 1].T
    # An edge runs from corner i to i + 1 of one triangle and from j to j + 1 of the other, backwards.
    start = np.abs(normals[t, i] - normals[other, (j + 1) % 3]).max(axis=1)
    end = np.abs(normals[t, (i + 1) % 3] - normals[other, j]).max(axis=1)
    joined = (np.maximum(start, end) < _FLAT) & smooth[t] & smooth[other]
    return np.where(smooth, _components(len(normals), t[joined].tobytes(), other[joined].tobytes()), -1)


# What follows from the numbers of corners and triangles alone is the same for meshes that differ in size, as
# the boxes and wheels of robots do from trial to trial.
@lru_cache(maxsize=256)
def _across(polygons: tuple[_Outline, ...], surfaces: bytes) -> Indices:
    """Return the face of the same surface across the edge that ends at each corner, or -1."""
    surface = np.frombuffer(surfaces, np.int64)
    sides = {
        (corners[i - 1], corners[i]): face
        for face, corners in enumerate(polygons)
        if surface[face] >= 0
        for i in range(len(corners))
    }
    across = []
    for face, corners in enumerate(polygons):
        for i in range(len(corners)):
            other = sides.get((corners[i], corners[i - 1]), -1)
            same = surface[face] >= 0 and other >= 0 and surface[other] == surface[face]
            across.append(other if same else -1)
    return np.array(across, dtype=np.int64)


@lru_cache(maxsize=256)
def _neighbours(triangles: bytes) -> Indices:
    """Return pairs of (triangle, edge) that share an edge, each once, shape (N, 2, 2)."""
    sides = {
        (a, b): (t, i)
        for t, corners in enumerate(np.frombuffer(triangles, np.int64).reshape(-1, 3).tolist())
        for i, (a, b) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True))
    }
    pairs = [(side, sides[b, a]) for (a, b), side in sides.items() if a < b and (b, a) in sides]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2, 2)


@lru_cache(maxsize=256)
def _components(count: int, one: bytes, other: bytes) -> Indices:
    """Return the connected component of each of ``count`` triangles, given the two triangles of each link."""
    from scipy.sparse import coo_array  # slow to import, and a check of a scene draws nothing
    from scipy.sparse.csgraph import connected_components

    a, b = np.frombuffer(one, np.int64), np.frombuffer(other, np.int64)
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _cross(a: Array, b: Array) -> Array:
    """Return the cross products of two sets of vectors, (..., 3); np.cross takes longer for small sets."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


@lru_cache(maxsize=256)
def _outlined(triangles: bytes, groups: bytes) -> tuple[tuple[list[int], _Outline | None], ...]:
    """Return the triangles of each group, and their outline if there are several and it is one loop.

    The bytes are those of vertex indices, shape (T, 3), and of the number of each triangle's group, (T,).
    """
    corners, labels = np.frombuffer(triangles, np.int64).reshape(-1, 3), np.frombuffer(groups, np.int64)
    order = np.argsort(labels, kind="stable")
    members = [g.tolist() for g in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1) if len(g)]
    return tuple((group, _outline(corners[group]) if len(group) > 1 else None) for group in members)


def _outline(triangles: Indices) -> _Outline | None:
    """Return the outline of triangles, counter-clockwise, or None unless it is one loop.

    Vertices in the middle of a straight side stay: a neighbour may have its corner there, and edges that are
    shared must be the same edges.
    """
    edges = {(int(t[i]), int(t[(i + 1) % 3])) for t in triangles for i in range(3)}
    border = [(a, b) for a, b in edges if (b, a) not in edges]
    after = dict(border)
    if len(after) != len(border) or len(border) > _MOST_CORNERS:
        return None
    first = min(after)
    outline = [first]
    while (following := after.get(outline[-1])) != first:
        if following is None or len(outline) > len(border):
            return None
        outline.append(following)
    return tuple(outline) if len(outline) == len(border) else None


def _are_convex(
    groups: Sequence[tuple[list[int], _Outline | None]], vertices: Array, normal: Array
) -> set[int]:
    """Return the numbers of the groups of coplanar triangles whose outline is convex.

    Groups are from :func:`_outlined`; vertices have shape (V, 3) [m], and normals of triangles (T, 3).
    """
    alike: dict[int, list[tuple[int, int, _Outline]]] = {}  # number, first triangle, outline; by corners
    for i, (group, outline) in enumerate(groups):
        if outline is not None:
            alike.setdefault(len(outline), []).append((i, group[0], outline))
    convex: set[int] = set()
    for several in alike.values():
        numbers, first, outlines = zip(*several, strict=True)
        p = vertices[np.array(outlines)]
        step = np.roll(p, -1, axis=1) - p
        turn = np.einsum("gka,ga->gk", _cross(step, np.roll(step, -1, axis=1)), normal[list(first)])
        straight = 1e-9 * (step * step).sum(axis=2).max(axis=1)
        turns_left = (turn >= -straight[:, None]).all(axis=1)
        convex.update(i for i, left in zip(numbers, turns_left.tolist(), strict=True) if left)
    return convex
