"""Welding changes the number of links that PyBullet steps, and no physical property."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

import msrr_bullet.simulation.unit_body
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.urdf_welding import weld
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import read_unit
from msrr_scenes.geometry.urdf_tree import urdf_origin
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from tests.bullet.conftest import two_units

APART = Placement({"a": SE2(0.2, -0.1, 0.4), "b": SE2(1.5, 0.0, 0.0)}, {})


def driven(scene) -> np.ndarray:
    """Poses and wheel angles of a unit that drives, turns and stops."""
    with BulletWorld(scene, APART) as world:
        plant = BulletPlant(world)
        rows = []
        for command in (Twist(0.2, 0.0), Twist(0.1, 0.8), Twist(-0.15, -0.4), Twist()):
            plant.command("a", command)
            for _ in range(120):
                plant.step()
                X = plant.pose("a")
                rows.append((X.x, X.y, X.yaw, *plant.wheel_angles("a"), len(world.unit("a").links)))
    return np.array(rows)


def test_a_welded_unit_moves_as_the_unwelded_one(monkeypatch) -> None:
    """The solver stops at a tolerance, so that the two are not equal bit for bit."""
    welded = driven(two_units())
    monkeypatch.setattr(msrr_bullet.simulation.unit_body, "weld", lambda tree, separate: None)
    unwelded = driven(two_units())
    assert welded[0, -1] == 7
    assert unwelded[0, -1] == 35
    np.testing.assert_allclose(welded[:, :-1], unwelded[:, :-1], rtol=0.0, atol=1e-5)


def random_chain(rng: np.random.Generator, links: int) -> ElementTree.ElementTree:
    """A tree of links behind fixed joints, each with a random mass and a box at a random pose."""

    def origin(parent) -> None:
        xyz, rpy = rng.uniform(-1, 1, 3), rng.uniform(-np.pi, np.pi, 3)
        ElementTree.SubElement(parent, "origin", xyz=" ".join(map(str, xyz)), rpy=" ".join(map(str, rpy)))

    robot = ElementTree.Element("robot", name="chain")
    for i in range(links):
        link = ElementTree.SubElement(robot, "link", name=f"l{i}")
        if i % 4 != 3:
            inertial = ElementTree.SubElement(link, "inertial")
            origin(inertial)
            ElementTree.SubElement(inertial, "mass", value=str(rng.uniform(0.1, 2.0)))
            a = rng.uniform(-0.2, 0.2, (3, 3))
            J = a @ a.T + 0.1 * np.eye(3)
            names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
            upper = dict(zip(names, map(str, J[np.triu_indices(3)]), strict=True))
            ElementTree.SubElement(inertial, "inertia", upper)
        for kind in ("visual", "collision"):
            shape = ElementTree.SubElement(link, kind)
            origin(shape)
            geometry = ElementTree.SubElement(shape, "geometry")
            ElementTree.SubElement(geometry, "box", size=f"{i + 1} 1 1")
    joints = [(i, int(rng.integers(i))) for i in range(1, links)]
    rng.shuffle(joints)
    for child, parent in joints:
        joint = ElementTree.SubElement(robot, "joint", name=f"j{child}", type="fixed")
        ElementTree.SubElement(joint, "parent", link=f"l{parent}")
        ElementTree.SubElement(joint, "child", link=f"l{child}")
        origin(joint)
    return ElementTree.ElementTree(robot)


def second_moments(tree: ElementTree.ElementTree) -> np.ndarray:
    """Sum over all links of the pseudo-inertia, shape (4, 4), in the frame of the root; it is additive.

    [[S, m c], [m c^T, m]] with S the second moment of the mass; J = tr(S) 1 - S about the origin.
    """
    parents = {j.find("child").get("link"): j for j in tree.getroot().findall("joint")}
    total = np.zeros((4, 4))
    for link in tree.getroot().findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        X = SE3()
        name = link.get("name")
        while name in parents:
            X = urdf_origin(parents[name].find("origin")) @ X
            name = parents[name].find("parent").get("link")
        X = X @ urdf_origin(inertial.find("origin"))
        mass = float(inertial.find("mass").get("value"))
        e = inertial.find("inertia")
        xx, xy, xz, yy, yz, zz = (float(e.get(n)) for n in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        own = np.zeros((4, 4))
        own[:3, :3] = 0.5 * np.trace(J) * np.eye(3) - J
        own[3, 3] = mass
        total += X.matrix() @ own @ X.matrix().T
    return total


def shapes(tree: ElementTree.ElementTree, kind: str) -> dict[str, SE3]:
    """Pose of every box in the frame of the root, by the size of the box."""
    parents = {j.find("child").get("link"): j for j in tree.getroot().findall("joint")}
    found = {}
    for link in tree.getroot().findall("link"):
        for shape in link.findall(kind):
            X, name = urdf_origin(shape.find("origin")), link.get("name")
            while name in parents:
                X = urdf_origin(parents[name].find("origin")) @ X
                name = parents[name].find("parent").get("link")
            found[shape.find("geometry/box").get("size")] = X
    return found


@pytest.mark.parametrize("seed", range(20))
def test_mass_inertia_and_shapes_stay_where_they_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_chain(rng, 9)
    separate = {f"l{i}" for i in rng.choice(np.arange(1, 9), size=seed % 3, replace=False)}
    moments, before = second_moments(tree), {k: shapes(tree, k) for k in ("visual", "collision")}
    weld(tree, separate)
    names = {link.get("name") for link in tree.getroot().findall("link")}
    assert names == {"l0", *separate}
    np.testing.assert_allclose(second_moments(tree), moments, atol=1e-9)
    for kind, poses in before.items():
        after = shapes(tree, kind)
        assert after.keys() == poses.keys()
        for size, X in poses.items():
            np.testing.assert_allclose(after[size].matrix(), X.matrix(), atol=1e-9)


def test_links_whose_contacts_are_queried_are_not_merged() -> None:
    geometry = read_unit(two_units().geometry("a").urdf)
    tree = geometry.tree()
    weld(tree, geometry.pins)
    names = {link.get("name") for link in tree.getroot().findall("link")}
    assert names == {
        "base",
        "wheel_left",
        "wheel_right",
        "caster_front",
        "caster_rear",
        *geometry.pins,
    }
