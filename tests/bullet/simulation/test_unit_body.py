"""Loading a unit: links, wheels and the frame U, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest

from msrr_bullet.simulation.unit_body import ROOT, load_unit
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry, read_unit
from tests.bullet.conftest import two_units


@pytest.fixture
def geometry() -> UnitGeometry:
    return two_units().geometry("a")


def test_frame_u_follows_from_the_pose_that_pybullet_reports(client: int, geometry: UnitGeometry) -> None:
    """Wheel axles, as PyBullet computes them, lie on the y axis of U at any pose of the unit."""
    unit = load_unit(client, geometry)
    X_WU = SE3.from_xyz_rpy([0.3, -0.7, 0.2], [0.1, -0.2, 2.0])
    X_WI = X_WU @ unit.X_IU.inverse()
    pybullet.resetBasePositionAndOrientation(
        unit.body, X_WI.p.tolist(), X_WI.quaternion_xyzw().tolist(), physicsClientId=client
    )
    for joint, side in zip(unit.wheels, (1.0, -1.0), strict=True):
        state = pybullet.getLinkState(unit.body, joint, computeForwardKinematics=True, physicsClientId=client)
        p_U = X_WU.inverse().act(np.array(state[4]))
        assert p_U[0] == pytest.approx(0.0, abs=1e-6)
        assert p_U[1] == pytest.approx(side * 0.5 * geometry.track, abs=1e-6)
    np.testing.assert_allclose(unit.origin, unit.X_IU.p)
    np.testing.assert_allclose(unit.forward, unit.X_IU.R[:, 0])


def test_links_are_found_by_name(client: int, geometry: UnitGeometry) -> None:
    unit = load_unit(client, geometry)
    assert [name for name, index in unit.links.items() if index == ROOT] == ["base"]
    assert (unit.link("wheel_left"), unit.link("wheel_right")) == unit.wheels
    assert set(geometry.pins) <= set(unit.links)
    with pytest.raises(UnknownNameError, match="unknown link 'pin_lft'; did you mean 'pin_left'"):
        unit.link("pin_lft")


def test_a_welded_link_adds_its_mass_or_none_and_one_apart_would_get_a_kilogram(
    client: int, geometry: UnitGeometry, tmp_path: Path
) -> None:
    """The reason why a scene is refused whose robot has shapes without inertial data."""
    masses = []
    for name, link in (("as_designed", None), ("welded", "mast"), ("apart", "caster_rear")):
        path = tmp_path / f"{name}.urdf"
        drawn = geometry.urdf.read_text()
        path.write_text(
            re.sub(rf'(<link name="{link}">\s*)<inertial>.*?</inertial>', r"\1", drawn, flags=re.S)
        )
        unit = load_unit(client, read_unit(path))
        links = (ROOT, unit.link("caster_rear"))
        masses.append([pybullet.getDynamicsInfo(unit.body, i, physicsClientId=client)[0] for i in links])
    drawn_mass, without_mast, apart = masses
    assert without_mast[0] < drawn_mass[0]
    assert without_mast[1] == drawn_mass[1]
    assert apart == [drawn_mass[0], 1.0]


def _as_loaded(client: int, geometry: UnitGeometry) -> list[object]:
    """Return what PyBullet has read: mass, inertia and contact of every link, and all collision shapes."""
    body = load_unit(client, geometry).body
    links = range(-1, pybullet.getNumJoints(body, physicsClientId=client))
    return [
        (
            pybullet.getDynamicsInfo(body, link, physicsClientId=client),
            [shape[2:] for shape in pybullet.getCollisionShapeData(body, link, physicsClientId=client)],
        )
        for link in links
    ]


@pytest.mark.parametrize("pad", [0, 3, 7, 11])
def test_a_urdf_on_a_single_line_is_loaded_with_the_same_numbers(
    client: int, geometry: UnitGeometry, tmp_path: Path, pad: int
) -> None:
    """PyBullet reads long lines in pieces, and loses digits between them."""
    tree = ElementTree.parse(geometry.urdf)
    for element in tree.iter():
        element.text = element.tail = None
    tree.getroot().set("name", "x" * (1 + pad))
    path = tmp_path / "one_line.urdf"
    tree.write(path)
    assert len(path.read_text().splitlines()) == 1
    assert _as_loaded(client, read_unit(path)) == _as_loaded(client, geometry)
