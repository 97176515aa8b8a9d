"""Mesh files: OBJ with materials, STL, and files that cannot be read."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.render.raster.mesh_file import read_mesh
from msrr_bullet.simulation.tag_plates import plate_scale, write_plate
from msrr_scenes.errors import GeometryError


def test_a_plate_has_the_texture_beside_it(tmp_path: Path) -> None:
    mesh, image = write_plate(tmp_path, 7)
    (part,) = read_mesh(mesh)
    assert part.texture == image
    sized = part.mesh.scaled(np.array(plate_scale(0.08)))
    p = sized.vertices[sized.triangles]
    np.testing.assert_allclose(np.abs(p), np.broadcast_to([0.05, 0.05, 0.0], (2, 3, 3)))
    area = 0.5 * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    np.testing.assert_allclose(area, [[0.0, 0.0, -0.005]] * 2, atol=1e-12)


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


def test_a_material_that_names_another_image_is_read_anew(tmp_path: Path) -> None:
    """Also where the image, or the library, is written after the mesh was read."""
    path, library = tmp_path / "deck.obj", tmp_path / "deck.mtl"
    path.write_text("mtllib deck.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n")
    seen = []
    for make in (
        lambda: None,
        lambda: library.write_text("newmtl m\nmap_Kd one.png\n"),
        (tmp_path / "one.png").touch,
        lambda: library.write_text("newmtl m\nmap_Kd two.png\n"),
        (tmp_path / "two.png").touch,
    ):
        make()
        texture = read_mesh(path)[0].texture
        seen.append(texture and texture.name)
    assert seen == [None, None, "one.png", None, "two.png"]
    path.write_text(path.read_text().replace("mtllib deck.mtl\n", ""))
    assert read_mesh(path)[0].texture is None
    (tmp_path / "deck.png").touch()
    assert read_mesh(path)[0].texture == tmp_path / "deck.png"


def test_a_binary_stl_file_is_drawn(tmp_path: Path) -> None:
    path = tmp_path / "b.STL"
    record = struct.pack("<12fH", 0, 0, 1, *(0, 0, 0), *(1, 0, 0), *(0, 1, 0), 0)
    path.write_bytes(b"solid, says this header".ljust(80) + struct.pack("<I", 1) + record)
    (part,) = read_mesh(path)
    edges = np.diff(part.mesh.vertices[part.mesh.triangles[0]], axis=0)
    np.testing.assert_allclose(np.cross(*edges), [0, 0, 1])


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.dae", "<xml/>", "reads .obj, .stl"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "element 3 of 1"),
        ("a.obj", "v 0 zero 0\n", "malformed"),
        ("a.obj", "v 0 0 0\n", "no faces"),
        ("a.stl", "solid nothing\nendsolid\n", "no triangles"),
        ("a.stl", 3 * "vertex 0 0 0\n", "an STL file of text, .*; write it as binary STL or OBJ"),
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
