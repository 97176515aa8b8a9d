"""Parts of the raster renderer: faces, textures, mesh files, patterns."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from msrr_bullet.render.floor import Floor, concrete_floor
from msrr_bullet.render.raster.assembly import assemble
from msrr_bullet.render.raster.faces import faces_of
from msrr_bullet.render.raster.kernels.ground import ground_of
from msrr_bullet.render.raster.kernels.pattern import CELL_SAMPLES, SAMPLES, rooks
from msrr_bullet.render.raster.look import VisualShape
from msrr_bullet.render.raster.mesh import Mesh, box, capsule, cylinder, segments, sphere
from msrr_bullet.render.raster.mesh_file import read_mesh
from msrr_bullet.render.raster.texture import rectangles, texture_of
from msrr_bullet.simulation.tag_plates import plate_texture, tag_bitmap, write_plate
from msrr_scenes.errors import GeometryError, SceneError
from msrr_scenes.geometry.se3 import SE3


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


def test_a_round_body_is_as_wide_as_it_should_be() -> None:
    for radius in (0.005, 0.033, 0.5):
        vertices = cylinder(radius, 0.1).vertices
        np.testing.assert_allclose(np.abs(vertices[:, :2]).max(axis=0), radius)
        hull = ConvexHull(vertices[:, :2])
        distance = -hull.equations[:, 2].max()
        assert distance > radius - max(1e-4, 0.005 * radius)


# --- textures ----------------------------------------------------------------------------------------------


@given(st.integers(0, 586))
@settings(max_examples=20, deadline=None)
def test_a_tag_is_kept_as_its_modules(tag: int) -> None:
    texture = texture_of(plate_texture(tag)[..., 0])
    assert texture.regions is not None
    np.testing.assert_array_equal(texture.levels[0] > 0.5, tag_bitmap(tag))
    np.testing.assert_array_equal(texture.region_grey[texture.regions], texture.levels[0])


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_regions_are_rectangles_of_one_grey(rows: int, columns: int, seed: int) -> None:
    cells = np.random.default_rng(seed).integers(0, 3, (rows, columns)).astype(np.uint8)
    regions = rectangles(cells)
    for region in range(regions.max() + 1):
        y, x = np.nonzero(regions == region)
        assert len(y) == (np.ptp(y) + 1) * (np.ptp(x) + 1)
        assert len(np.unique(cells[y, x])) == 1


def test_a_blank_plate_is_one_cell_and_a_photograph_a_pyramid() -> None:
    assert texture_of(plate_texture(None)[..., 0]).levels[0].shape == (1, 1)
    photo = np.random.default_rng(0).integers(0, 256, (50, 70)).astype(np.uint8)
    texture = texture_of(photo)
    assert texture.regions is None
    assert [level.shape for level in texture.levels][:2] == [(64, 128), (32, 64)]
    assert texture.levels[-1].shape == (1, 1)
    assert float(texture.levels[-1][0, 0]) == pytest.approx(photo.mean() / 255.0, abs=0.01)


# --- mesh files --------------------------------------------------------------------------------------------


def test_a_plate_wears_the_picture_beside_it(tmp_path: Path) -> None:
    mesh, picture = write_plate(tmp_path, "plate", 0.08, 7)
    (part,) = read_mesh(mesh)
    assert part.texture == picture
    (quad,) = polygons(part.mesh)
    np.testing.assert_allclose(np.abs(quad), [[0.05, 0.05, 0.0]] * 4)
    np.testing.assert_allclose(area_vector(quad), [0.0, 0.0, -0.01], atol=1e-12)


def test_obj_with_materials_negative_indices_and_polygons(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd skin.png\nnewmtl bare\nKd 1 0 0\n")
    (tmp_path / "skin.png").write_bytes(b"")
    (tmp_path / "m.png").write_bytes(b"not this one: the mesh names its materials")
    path = tmp_path / "m.obj"
    path.write_text(
        "# a square, a triangle\nmtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
        "vt 0 1\nusemtl skin\nf -4/-4 -3/-3 -2/-2 -1/-1\nv 0 0 1\nusemtl bare\nf 1 \\\n 2 5\n"
    )
    square, triangle = read_mesh(path)
    assert (square.texture, triangle.texture) == (tmp_path / "skin.png", None)
    assert square.mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert square.mesh.uv is not None
    assert triangle.mesh.triangles.tolist() == [[0, 1, 4]]
    assert triangle.mesh.uv is None


def test_stl_both_ways(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4")
    binary, text = tmp_path / "b.stl", tmp_path / "t.STL"
    record = struct.pack("<12fH", 0, 0, 1, *corners.reshape(-1), 0)
    binary.write_bytes(b"solid, says this header".ljust(80) + struct.pack("<I", 1) + record)
    lines = "".join(f"vertex {a} {b} {c}\n" for a, b, c in corners)
    text.write_text(f"solid t\nfacet normal 0 0 1\nouter loop\n{lines}endloop\nendfacet\nendsolid t\n")
    for path in (binary, text):
        (part,) = read_mesh(path)
        np.testing.assert_allclose(
            np.cross(*np.diff(part.mesh.vertices[part.mesh.triangles[0]], axis=0)), [0, 0, 1]
        )


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.dae", "<xml/>", "reads .obj, .stl"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "element 3 of 1"),
        ("a.obj", "v 0 zero 0\n", "malformed"),
        ("a.obj", "v 0 0 0\n", "no faces"),
        ("a.stl", "solid nothing\nendsolid\n", "no triangles"),
    ],
)
def test_a_bad_mesh_file_is_named(tmp_path: Path, name: str, content: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(GeometryError, match=words) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)


def test_a_missing_mesh_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(GeometryError, match=r"no\.obj: cannot read"):
        read_mesh(tmp_path / "no.obj")


def test_a_mirrored_mesh_keeps_its_outside_outside() -> None:
    mirrored = SOLIDS["cylinder"][0].scaled(np.array([1.0, -2.0, 1.0]))
    for polygon in polygons(mirrored):
        assert float(polygon.mean(axis=0) @ area_vector(polygon)) > 0.0
    faces = faces_of(mirrored)
    outward = np.einsum("fka,fa->fk", faces.corner_normals, faces.planes[:, :3])
    assert (outward > 0.9).all()


# --- assembly, floor, patterns -----------------------------------------------------------------------------


def test_assembly_puts_shapes_into_their_movers_frames() -> None:
    X_MG = SE3.from_xyz_rpy([0.1, -0.2, 0.3], [0.3, -0.4, 1.2])
    mesh = box(np.array([0.3, 0.2, 0.1]))
    geometry, _ = assemble([VisualShape(0, SE3(), mesh, 1.0), VisualShape(1, X_MG, mesh, 0.5)])
    start, end = geometry.shape_face[1], geometry.shape_face[2]
    for face in range(start, end):
        corners = geometry.corners[geometry.corner_start[face] : geometry.corner_start[face + 1]]
        n, d = geometry.planes[face, :3], geometry.planes[face, 3]
        np.testing.assert_allclose(geometry.vertices[corners] @ n, d, atol=1e-12)
    np.testing.assert_allclose(geometry.shape_ball[1, :3], X_MG.p, atol=1e-12)
    assert geometry.shape_ball[1, 3] == pytest.approx(0.5 * math.sqrt(0.14))
    assert set(geometry.grey[start:end]) == {127.5}
    nothing, _ = assemble([])
    assert len(nothing.planes) == 0


def test_a_floor_that_is_no_pyramid_is_refused() -> None:
    level = np.zeros((4, 4), dtype=np.float32)
    with pytest.raises(SceneError, match="pyramid"):
        ground_of(Floor((level, level), 1.0, 0.0))
    with pytest.raises(SceneError, match="outside 0 to 255"):
        ground_of(Floor((np.full((1, 1), 300.0, dtype=np.float32),), 1.0, 0.0))
    assert ground_of(concrete_floor()) is ground_of(concrete_floor())


@pytest.mark.parametrize("samples", [SAMPLES, CELL_SAMPLES])
def test_samples_share_no_row_and_no_column_and_have_no_bias(samples: int) -> None:
    places = rooks(samples)
    steps = (np.arange(samples) + 0.5) / samples
    for axis in range(2):
        np.testing.assert_allclose(np.sort(places[axis]), steps, atol=1e-7)
    worst, squares = 0.0, []
    for angle in np.linspace(0.0, math.pi, 60, endpoint=False) + 0.01:
        a, b = math.cos(angle), math.sin(angle)
        along = (places[0] - 0.5) * a + (places[1] - 0.5) * b
        for t in np.linspace(-0.7, 0.7, 41):
            p, q, x = abs(a), abs(b), t + 0.5 * (abs(a) + abs(b))
            area = sum(s * max(x - o, 0.0) ** 2 for s, o in ((1, 0), (-1, p), (-1, q), (1, p + q))) / (
                2 * p * q
            )
            error = float((along < t).mean()) - area
            worst = max(worst, abs(error))
            squares.append(error**2)
    assert worst < {16: 0.11, 32: 0.075}[samples]
    assert math.sqrt(np.mean(squares)) < {16: 0.031, 32: 0.0185}[samples]
