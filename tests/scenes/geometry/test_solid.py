"""Collision shapes: the points that span them lie on them, and their outline is the shadow on the ground."""

import math
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.mesh_points import obj_vertices
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.solid import Solid, convex_hull, read_solids

X_UG = SE3.from_xyz_rpy([0.1, -0.2, 0.3], [0.0, 0.0, 0.5])


def test_the_points_of_a_shape_lie_on_it() -> None:
    box = X_UG.inverse().act(Solid("a", "box", X_UG, (0.2, 0.4, 0.6)).points())
    np.testing.assert_allclose(np.abs(box), np.broadcast_to([0.1, 0.2, 0.3], (8, 3)), atol=1e-12)
    cylinder = X_UG.inverse().act(Solid("a", "cylinder", X_UG, (0.3, 0.8)).points())
    np.testing.assert_allclose(np.hypot(cylinder[:, 0], cylinder[:, 1]), 0.3)
    np.testing.assert_allclose(np.abs(cylinder[:, 2]), 0.4)
    sphere = X_UG.inverse().act(Solid("a", "sphere", X_UG, (0.3,)).points())
    np.testing.assert_allclose(np.linalg.norm(sphere, axis=1), 0.3)


def test_the_outline_is_the_projection_to_the_ground() -> None:
    lying = SE3.from_xyz_rpy([0.1, 0.0, 0.3], [math.pi / 2, 0.0, 0.0])  # axis along y
    outline = Solid("a", "cylinder", lying, (0.3, 0.8)).outline()
    np.testing.assert_allclose(outline.max(axis=0), [0.4, 0.4], atol=1e-12)
    hull = convex_hull(outline)
    following = np.roll(hull, -1, axis=0)
    area = 0.5 * (hull[:, 0] * following[:, 1] - hull[:, 1] * following[:, 0]).sum()
    assert area == pytest.approx(0.6 * 0.8)  # positive: counter-clockwise


@pytest.mark.parametrize("tilt", [0.0, 2.7e-6])
def test_a_disc_is_never_larger_than_its_outline(tilt: float) -> None:
    """Start poses are checked by outlines and judged by discs; URDFs turn cylinders by 3.14159."""
    X = SE3.from_xyz_rpy([0.2, -0.1, 0.3], [math.pi + tilt, 0.0, 0.4])
    for solid in (Solid("a", "sphere", X_UG, (0.3,)), Solid("a", "cylinder", X, (0.3, 0.8))):
        assert solid.is_disc
        corners = solid.outline() - solid.X_UG.p[:2]
        edges = np.roll(corners, -1, axis=0) - corners
        apart = np.abs(corners[:, 0] * edges[:, 1] - corners[:, 1] * edges[:, 0]) / np.hypot(*edges.T)
        np.testing.assert_allclose(apart, 0.3, rtol=1e-9)


def test_a_mesh_is_read_and_scaled(tmp_path: Path) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text("v 1 2 3\nvn 0 0 1\nv -1 0.5 2e0\nf 1 2 1\n")
    points = Solid("a", "mesh", X_UG, (0.1, 0.2, 0.3), path).points()
    np.testing.assert_allclose(X_UG.inverse().act(points), [[0.1, 0.4, 0.9], [-0.1, 0.1, 0.6]], atol=1e-12)
    path.write_text("f 1 2 3\n")
    with pytest.raises(GeometryError, match="no vertices"):
        obj_vertices(path)


@pytest.mark.parametrize("seed", range(20))
def test_the_hull_is_that_of_scipy(seed: int) -> None:
    """On a grid of micrometres many corners coincide and many lie on one line."""
    rng = np.random.default_rng(seed)
    points = rng.integers(-5, 6, size=(int(rng.integers(8, 200)), 2)) * 1e-6 * 10.0 ** int(rng.integers(0, 6))
    hull, corners = convex_hull(points), points[ConvexHull(points).vertices]
    assert {tuple(p) for p in hull} == {tuple(p) for p in corners}
    step = np.roll(hull, -1, axis=0) - hull
    ahead = np.roll(step, -1, axis=0)
    assert (step[:, 0] * ahead[:, 1] - step[:, 1] * ahead[:, 0] > 0.0).all()  # left turns all the way round
    assert hull[0, 0] == points[:, 0].min()


@pytest.mark.parametrize("turn_deg", [0.0, 90.0, -90.0, 180.0, -180.0, 270.0])
def test_the_hull_of_an_upright_rectangle_is_whole_whatever_its_angle_was_rounded_to(turn_deg: float) -> None:
    """Points of one edge are off the vertical by less than a rounding, in any order."""
    grid = np.array([[x, y] for x in (-0.35, -0.13, 0.15, 0.37) for y in (-0.1, 0.1)])
    for k in range(-40, 41):
        X = SE2(0.3, -0.2, math.radians(turn_deg) + k * 2.3e-16)
        turned = X.act(np.roll(grid, k, axis=0))
        hull = convex_hull(turned)
        step = np.roll(hull, -1, axis=0) - hull
        rel = turned[:, None] - hull[None]
        assert (step[:, 0] * rel[..., 1] - step[:, 1] * rel[..., 0] > -1e-12).all()


def test_points_on_one_line_have_no_hull() -> None:
    with pytest.raises(GeometryError, match="3 points on one line"):
        convex_hull(np.array([[0.0, 0.0], [0.1, 0.2], [0.3, 0.6]]))


def test_vertices_of_a_file_may_stand_behind_tabs(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("# by hand\nv\t1 2\t3\nvn 0 0 1\n  v 4 5 6 1.0\n")
    np.testing.assert_array_equal(obj_vertices(tmp_path / "a.obj"), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


def test_every_object_of_a_mesh_is_a_shape_of_its_own(tmp_path: Path) -> None:
    """A socket that was taken apart into convex pieces has a hole; the hull of all of them has none."""
    text = ""
    for k, y in enumerate((-0.05, 0.05)):
        corners = [(a, y + b, c) for a in (0.0, 0.1) for b in (-0.01, 0.01) for c in (0.0, 0.1)]
        faces = "".join(f"f {8 * k + 1} {8 * k + i} {8 * k + i + 1}\n" for i in range(2, 8))
        text += f"o wall_{k}\n" + "".join(f"v {a} {b} {c}\n" for a, b, c in corners) + faces
    path = tmp_path / "socket.obj"
    path.write_text(text)
    collision = fromstring(f'<collision><geometry><mesh filename="{path}"/></geometry></collision>')
    left, right = (solid.points() for solid in read_solids("socket", SE3(), collision))
    assert left[:, 1].max() < 0.0 < right[:, 1].min()
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    with pytest.raises(GeometryError, match="no faces in this mesh"):
        read_solids("socket", SE3(), collision)


@pytest.mark.parametrize(
    ("kind", "size"), [("sphere", (0.02,)), ("cylinder", (0.02, 0.05)), ("box", (0.1, 0.2, 0.05))]
)
def test_the_lowest_point_of_a_turned_shape_is_exact(kind: str, size: tuple[float, ...]) -> None:
    """By 32 points on each circle it was up to a fiftieth of the radius too high."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        X = SE3.from_xyz_rpy(rng.normal(size=3).tolist(), rng.uniform(-3.0, 3.0, 3).tolist())
        down = np.abs(X.R[2])
        reach = {
            "sphere": size[0],
            "cylinder": size[0] * math.hypot(down[0], down[1]) + 0.5 * size[-1] * down[2],
            "box": 0.5 * float(down @ np.resize(size, 3)),
        }[kind]
        solid = Solid("", kind, X, size)
        assert solid.lowest()[2] == pytest.approx(X.p[2] - reach, abs=1e-12)
        inside = X.inverse().act(solid.lowest())
        assert np.abs(inside).max() <= max(size) + 1e-9
