"""Collision meshes and cylinders are as large in the engine as they are drawn."""

from __future__ import annotations

import math
from pathlib import Path

import pybullet
import pytest

from msrr_bullet.simulation.unit_body import load_unit
from msrr_scenes.geometry.mesh_points import obj_objects
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit

_FACES = ["1/1/1 2/2/2 4/3/3 3/4/4", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]


def _box(middle_mm: float, half_mm: float) -> str:
    """Vertices of a box of 60 mm x 40 mm and a height, around a place ahead of the axle."""
    corners = [(x, y, z) for x in (-30, 30) for y in (-20, 20) for z in (-half_mm, half_mm)]
    return "".join(f"v {x + middle_mm} {y} {z}\n" for x, y, z in corners)


def _thicknesses(folder: Path, client: int, geometry: str, *places: float, rpy: str = "0 0 0") -> list[float]:
    """Thickness of a shape that the shipped robot carries 1 m up, at places ahead of the axle [m].

    Balls touch it from above and from below. It shares a link with the shapes of the body.
    """
    urdf = find_urdf("unit.urdf").read_text()
    at = urdf.index("</link>", urdf.index('<link name="base"'))
    shape = f'<collision><origin xyz="0 0 1" rpy="{rpy}"/><geometry>{geometry}</geometry></collision>'
    path = folder / "own.urdf"
    path.write_text(urdf[:at] + shape + urdf[at:])
    body = load_unit(client, read_unit(path)).body
    ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.01, physicsClientId=client)
    found = []
    for x in places:
        thickness = 0.8 - 0.02
        for z in (0.6, 1.4):
            other = pybullet.createMultiBody(0, ball, basePosition=[x, 0.0, z], physicsClientId=client)
            thickness -= min(
                p[8] for p in pybullet.getClosestPoints(body, other, 2.0, physicsClientId=client)
            )
        found.append(thickness)
    return found


@pytest.mark.parametrize(("half_mm", "excess_mm"), [(50.0, 0.0), (1.5, 0.0), (0.8, 0.56), (0.0, 2.0)])
def test_a_mesh_is_as_thick_as_it_is_drawn(
    tmp_path: Path, client: int, half_mm: float, excess_mm: float
) -> None:
    """Of what is thinner than two margins, a tenth is left, and the margins; a plane has them alone."""
    mesh = tmp_path / "box.obj"
    mesh.write_text(_box(0.0, half_mm) + "".join(f"f {face}\n" for face in _FACES))
    shape = f'<mesh filename="{mesh}" scale="0.001 -0.001 0.001"/>'
    [thickness] = _thicknesses(tmp_path, client, shape, 0.0)
    assert thickness == pytest.approx(1e-3 * (2.0 * half_mm + excess_mm), abs=2e-5)


def test_a_thin_rod_is_as_thick_as_it_is_drawn_though_most_of_its_vertices_are_at_one_end(
    tmp_path: Path, client: int
) -> None:
    """Of a rod of 5 mm the tip is finely meshed, and the middle of all vertices is 0.5 mm below it."""
    radius, lines, rings = 0.0025, ["o rod"], 200
    for k in range(-1, rings):
        x, around = (
            (-0.03, radius) if k < 0 else (0.03 + 2e-6 * k, radius * math.sqrt(1.0 - (k / rings) ** 2))
        )
        turns = (2.0 * math.pi * side / 24 for side in range(24))
        lines += [f"v {x} {around * math.cos(t)} {around * math.sin(t)}" for t in turns]
    mesh = tmp_path / "rod.obj"
    faces = [f"f {k + 1} {k + 2} {k + 25}" for k in range(24 * rings)]
    mesh.write_text("\n".join([*lines, *faces]) + "\n")
    shape = f'<mesh filename="{mesh}"/>'
    for thickness in _thicknesses(tmp_path, client, shape, -0.02, 0.0, 0.02):
        assert thickness == pytest.approx(2.0 * radius, abs=3e-5)


def test_every_object_of_a_file_is_a_hull_of_its_own(tmp_path: Path, client: int) -> None:
    """Faces count vertices from the first of the file, or back from the last one so far."""
    absolute = "".join(f"f {face}\n" for face in _FACES)
    back = "".join(f"f {' '.join(str(int(n) - 9) for n in face.split())}\n" for face in _FACES[1:])
    path = tmp_path / "two.obj"
    path.write_text(f"o behind\n{_box(-300.0, 50.0)}{absolute}g ahead\n{_box(300.0, 20.0)}{back}o empty\n")
    behind, ahead = obj_objects(path)
    assert behind.shape == ahead.shape == (8, 3)
    assert behind[:, 0].max() < 0.0 < ahead[:, 0].min()
    shape = f'<mesh filename="{path}" scale="0.001 0.001 0.001"/>'
    *thick, between = _thicknesses(tmp_path, client, shape, -0.3, 0.3, 0.0)
    assert thick == pytest.approx([0.1, 0.04], abs=2e-5)
    assert between < 0.0


def test_a_cylinder_is_round_and_as_large_as_it_is_drawn(tmp_path: Path, client: int) -> None:
    """Turned by half of the angle between the corners of a prism of 32 sides."""
    lying = f"{math.pi / 2} 0 0"
    shape = '<cylinder radius="0.05" length="0.1"/>'
    [thickness] = _thicknesses(tmp_path, client, shape, 0.0, rpy=lying)
    assert thickness == pytest.approx(0.1, abs=1e-5)


def test_a_sharp_tip_keeps_its_place(tmp_path: Path, client: int) -> None:
    """Faces a margin inside those of a cone of 20 degrees would meet 5 mm short of it."""
    ring = [(8.0 * math.cos(k * math.pi / 12), 8.0 * math.sin(k * math.pi / 12)) for k in range(24)]
    corners = "".join(f"v {x} {y} -20\n" for x, y in ring) + "v 0 0 25\n"
    faces = "".join(f"f {k + 1} {(k + 1) % 24 + 1} 25\n" for k in range(24))
    mesh = tmp_path / "cone.obj"
    mesh.write_text(f"{corners}{faces}f {' '.join(str(k + 1) for k in range(24))}\n")
    shape = f'<mesh filename="{mesh}" scale="0.001 0.001 0.001"/>'
    [thickness] = _thicknesses(tmp_path, client, shape, 0.0)
    assert thickness == pytest.approx(0.045, abs=3e-4)
