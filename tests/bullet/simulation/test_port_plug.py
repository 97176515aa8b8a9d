"""The plug of a port: where the bodies stand, what they collide with, and their removal."""

import re

import numpy as np
import pybullet
import pytest

from msrr_bullet.plant.kinematic_port import PLUG_LENGTH
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.port_plug import PortPlug
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.messages import Twist
from tests.bullet.conftest import before_port, two_units


@pytest.fixture
def world():
    scene = two_units()
    with BulletWorld(scene, before_port(scene, SE2(-0.5, 0.0, 0.0))) as world:
        yield world


@pytest.mark.parametrize("port", ["rear", "left", "right"])
def test_a_plug_reaches_from_the_bottom_of_each_hole_towards_the_mouth(world, port):
    plug = PortPlug(world, "b", port)
    assert len(plug.bodies) == 2
    X_DW = world.pose3("b").inverse()
    X_PU = world.unit("b").geometry.frame(f"port_{port}").inverse()
    holes = [s for s in world.unit("b").geometry.solids if s.link.startswith(f"port_{port}_hole_")]
    for body, hole in zip(plug.bodies, holes, strict=True):
        position, _ = pybullet.getBasePositionAndOrientation(body, physicsClientId=world.client)
        x, y, z = X_PU.act(X_DW.act(np.array(position)))
        bottom = (X_PU @ hole.X_UG).p + np.array([0.5 * hole.size[0], 0.0, 0.0])
        assert x - 0.5 * PLUG_LENGTH == pytest.approx(bottom[0], abs=1e-6)
        assert (y, z) == pytest.approx(bottom[1:], abs=1e-6)
        assert x < 0.0  # inside the port, behind the face


def test_a_plug_does_not_push_the_unit_and_can_be_removed(world):
    before = world.pose("b")
    plug = PortPlug(world, "b", "rear")
    bodies = list(plug.bodies)
    for _ in range(120):
        world.step()
    after = world.pose("b")
    assert np.hypot(after.x - before.x, after.y - before.y) < 1e-4
    for body in bodies:
        assert not pybullet.getContactPoints(
            bodyA=body, bodyB=world.unit("b").body, physicsClientId=world.client
        )
    count = pybullet.getNumBodies(physicsClientId=world.client)
    plug.remove()
    plug.remove()  # a second call does nothing
    assert plug.bodies == []
    assert pybullet.getNumBodies(physicsClientId=world.client) == count - 2


def test_a_plug_stays_in_the_port_of_a_unit_that_drives(world):
    """It stood where the port had been, invisible in the open, and the next unit ran into it there."""
    plant = BulletPlant(world)
    plant.set_plug("b", "rear", True)

    def places():
        X_UW = world.pose3("b").inverse()
        bodies = plant.plug_bodies("b", "rear")
        poses = (pybullet.getBasePositionAndOrientation(b, physicsClientId=world.client) for b in bodies)
        return np.array([X_UW.act(np.array(position)) for position, _ in poses])

    before, start = places(), world.pose("b")
    plant.command("b", Twist(0.15, 0.5))
    for _ in range(240):
        plant.step()
    assert abs(world.pose("b").yaw - start.yaw) > 0.3
    np.testing.assert_allclose(places(), before, atol=1e-3)


def test_a_port_without_holes_cannot_be_plugged(world):
    with pytest.raises(GeometryError, match="'front' has no holes"):
        PortPlug(world, "b", "front")


def test_a_plug_stands_on_the_bottom_of_a_hole_however_that_box_is_turned(tmp_path):
    """Where the x axis of the box pointed into the unit, the plug stood behind the bottom."""
    text, places = find_urdf("unit.urdf").read_text(), []
    for yaw in (0.0, np.pi):
        drawn = text
        for link in re.findall(r'<link name="port_rear_hole_.*?</link>', text, re.DOTALL):
            drawn = drawn.replace(link, link.replace('xyz="0 0 0"', f'xyz="0 0 0" rpy="0 0 {yaw}"'))
        path = tmp_path / f"{yaw}.urdf"
        path.write_text(drawn)
        units = {name: {"number": k + 1, "urdf": str(path)} for k, name in enumerate("ab")}
        scene = two_units(units=units)
        with BulletWorld(scene, before_port(scene, SE2(-0.5, 0.0, 0.0))) as world:
            bodies = PortPlug(world, "b", "rear").bodies
            at = [pybullet.getBasePositionAndOrientation(b, physicsClientId=world.client)[0] for b in bodies]
            places.append(at)
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)
