"""Faces of meshes: closed, outward, as few as can be, shaded as the mesh is."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from msrr_bullet.render.raster.faces import faces_of
from msrr_bullet.render.raster.mesh import Mesh, box, capsule, cylinder, segments, sphere


def polygons(mesh: Mesh) -> list[np.ndarray]:
    faces = faces_of(mesh)
    return [
        faces.vertices[faces.corners[a:b]] for a, b in zip(faces.start[:-1], faces.start[1:], strict=True)
    ]


def area_vector(polygon: np.ndarray) -> np.ndarray:
    p = polygon - polygon[0]
    return 0.5 * np.cross(p[1:-1], p[2:]).sum(axis=0)


SOLIDS = {
    "box": (box(np.array([0.3, 0.2, 0.1])), 0.3 * 0.2 * 0.1),
    "cylinder": (cylinder(0.05, 0.2), math.pi * 0.05**2 * 0.2),
    "sphere": (sphere(0.1), 4.0 / 3.0 * math.pi * 0.1**3),
    "capsule": (capsule(0.05, 0.2), math.pi * 0.05**2 * 0.2 + 4.0 / 3.0 * math.pi * 0.05**3),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_faces_close_a_solid_and_look_outwards(name: str) -> None:
    mesh, volume = SOLIDS[name]
    found = polygons(mesh)
    areas = np.array([area_vector(p) for p in found])
    np.testing.assert_allclose(areas.sum(axis=0), 0.0, atol=1e-12)
    inside = sum(float(p[0] @ a) for p, a in zip(found, areas, strict=True)) / 3.0
    assert inside == pytest.approx(volume, rel=0.005)
    edges = [(tuple(p[i - 1]), tuple(p[i])) for p in found for i in range(len(p))]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges), "every edge has its reverse"


def test_coplanar_triangles_become_one_face_where_that_is_convex() -> None:
    assert sorted(len(p) for p in polygons(SOLIDS["box"][0])) == [4] * 6
    n = segments(0.05)
    assert sorted(len(p) for p in polygons(SOLIDS["cylinder"][0])) == [4] * n + [n, n]
    # An L of three squares is no convex face; its triangles stay.
    points = np.array([[x, y, 0.0] for y in range(3) for x in range(3)])
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6]])
    corner = Mesh(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    assert len(polygons(corner)) == 6
    row = Mesh(points, np.concatenate([quads[:2][:, [0, 1, 2]], quads[:2][:, [0, 2, 3]]]))
    assert [len(p) for p in polygons(row)] == [6], "vertices within a side stay: a neighbour may end there"


def test_meshes_of_the_same_triangles_have_faces_of_their_own() -> None:
    """A convex quad is one face, a dart is not convex, a folded sheet is not flat; any may come first."""
    triangles = np.array([[0, 1, 3], [0, 3, 2]])
    corners = {  # in the same order along x, by which vertices are sorted
        "quad": [[0.0, 0.0, 0.0], [3.0, -1.0, 0.0], [1.0, 2.0, 0.0], [2.0, 1.0, 0.0]],
        "dart": [[0.0, 0.0, 0.0], [3.0, -1.0, 0.0], [1.0, 2.0, 0.0], [1.5, 0.2, 0.0]],
        "folded": [[0.0, 0.0, 0.0], [3.0, -1.0, 0.3], [1.0, 2.0, 0.3], [2.0, 1.0, 0.0]],
    }
    for size, names in enumerate(itertools.permutations(corners), start=1):
        found = {name: len(polygons(Mesh(size * np.array(corners[name]), triangles))) for name in names}
        assert found == {"quad": 1, "dart": 2, "folded": 2}


def test_shading_normals_are_interpolated_over_a_face() -> None:
    faces = faces_of(SOLIDS["sphere"][0])
    assert faces.smooth.all()
    for face in range(0, len(faces.planes), 37):
        for vertex in faces.corners[faces.start[face] : faces.start[face + 1]]:
            p = faces.vertices[vertex]
            second, third = faces.weights[face] @ np.append(p, 1.0)
            one, two, three = faces.corner_normals[face]
            normal = one + second * (two - one) + third * (three - one)
            np.testing.assert_allclose(normal, p / 0.1, atol=1e-9)
    assert len(set(faces.surface)) == 1, "a sphere is one surface"
    assert (faces.across >= 0).all()
