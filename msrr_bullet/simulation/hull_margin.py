"""Collision meshes that are as large in the engine as they are drawn.

PyBullet puts a margin around the convex hulls of a URDF, by which pins no longer fit their holes and wheels
no longer reach the floor. The margin of hulls that share a link cannot be changed, so hulls are made smaller
by it before they are loaded. With the margin they have the faces that were drawn, and round edges.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.mesh_points import obj_objects

#: Margin of the convex hulls of a URDF in PyBullet [m].
_MARGIN_M = 1e-3

#: Share of the distance from the middle of a hull to its nearest face by which faces move at most: something
#: has to be left of what is thinner than two margins.
_MOST = 0.9

#: Way of a corner inwards, in margins, from which on it is a sharp tip; of a cube it is the root of three.
_SHARP = 2.0

#: Number of corners from which on only one in each cube of that edge [m] is kept.
_MANY, _APART_M = 1000, 1e-4

#: Points that are all nearer to a plane are flat [m].
_FLAT_M = 1e-6


def inset_meshes(tree: ElementTree[Element], folder: Path, stem: str) -> None:
    """Replace the collision meshes of a URDF by hulls that are smaller by the margin, in place.

    The meshes are OBJ files with absolute paths; the hulls are written to an existing folder, with names that
    begin with ``stem``.
    """
    for number, mesh in enumerate(tree.getroot().iterfind(".//collision/geometry/mesh")):
        scale = np.array([float(word) for word in mesh.get("scale", "1 1 1").split()])
        lines: list[str] = []
        count = 0
        for k, points in enumerate(obj_objects(Path(mesh.attrib["filename"]))):
            inner, triangles = _inset(points * scale)
            lines.append(f"o part_{k}")
            lines += ["v " + " ".join(map(repr, point)) for point in inner.tolist()]
            lines += ["f " + " ".join(map(str, row)) for row in (triangles + count + 1).tolist()]
            count += len(inner)
        path = folder / f"{stem}_hull_{number}.obj"
        path.write_text("\n".join(lines) + "\n")
        mesh.set("filename", str(path))
        mesh.set("scale", "1 1 1")


def _inset(points: Array) -> tuple[Array, NDArray[np.int_]]:
    """Return the corners of a hull, shape (N, 3), whose faces lie a margin inside, and its triangles, (M, 3).

    A flat hull has no inside and stays as it is.
    """
    # Slow to import, and few robots have meshes.
    from scipy.spatial import ConvexHull, HalfspaceIntersection, KDTree

    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=_FLAT_M) < 3:
        number = np.arange(1, len(points) - 1)
        return points, np.column_stack([np.zeros_like(number), number, number + 1])
    hull = ConvexHull(points)
    planes = hull.equations  # outward normal and offset: inside where their sum is negative
    middle = points[hull.vertices].mean(axis=0)
    depth = -(planes[:, :3] @ middle + planes[:, 3]).max()
    if _MOST * depth < _MARGIN_M:  # near the end of a rod, say, if that end has most of the vertices
        middle, depth = _deepest(planes)
    planes[:, 3] += min(_MARGIN_M, _MOST * depth)
    inner = np.asarray(HalfspaceIntersection(planes, middle).intersections, dtype=np.float64)
    # Faces would take a sharp tip away: it ends a margin inside, with flanks that are a little large.
    corners = points[hull.vertices]
    ways = inner[np.asarray(KDTree(inner).query(corners)[1])] - corners
    lost = np.linalg.norm(ways, axis=1)
    tips = lost > _SHARP * _MARGIN_M
    inward = ways[tips] / lost[tips, np.newaxis]
    inner = np.concatenate([inner, corners[tips] + _MARGIN_M * inward])
    if len(inner) > _MANY:  # of a round shape each corner has become several
        inner = inner[np.unique(np.floor(inner / _APART_M), axis=0, return_index=True)[1]]
    return inner, ConvexHull(inner).simplices.astype(np.int_)


def _deepest(planes: Array) -> tuple[Array, float]:
    """Return the point of a hull that is farthest from its faces (the Chebyshev centre), and how far [m]."""
    from scipy.optimize import linprog

    per_m = 1e3  # in millimetres the tolerance of the solver is 0.1 nm
    farther = np.column_stack([planes[:, :3], np.ones(len(planes))])
    free = (None, None)
    found = linprog(
        [0.0, 0.0, 0.0, -1.0], farther, -per_m * planes[:, 3], bounds=[free, free, free, (0.0, None)]
    )
    assert found.x is not None, "a hull has an inside"
    return found.x[:3] / per_m, float(found.x[3]) / per_m
