"""The PyBullet world: poses, settings, obstacles, the floor, and the client."""

import math
import re

import numpy as np
import pybullet
import pytest

from msrr_bullet.simulation.floor import GRAVITY_MPS2
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.checks.standing import standing_problems
from msrr_scenes.errors import GeometryError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.placement.placement import Placement
from tests.bullet.conftest import two_units

OBSTACLES = {
    "post": {"shape": "cylinder", "radius_m": 0.05, "height_m": 0.2},
    "crate": {"shape": "box", "length_m": 0.2, "width_m": 0.1, "appears_at_s": 0.5},
}
PLACEMENT = Placement(
    {"a": SE2(-0.5, 0.3, 2.0), "b": SE2(0.6, -0.2, -0.7)},
    {"post": SE2(0.0, 1.0, 0.0), "crate": SE2(0.0, -1.0, 0.5)},
)


@pytest.fixture
def world():
    with BulletWorld(two_units(obstacles=OBSTACLES), PLACEMENT) as world:
        yield world


def close(X, Y, tol=1e-9):
    np.testing.assert_allclose(X.R, Y.R, atol=tol)
    np.testing.assert_allclose(X.p, Y.p, atol=tol)


def test_units_are_placed_by_the_axle_not_by_the_centre_of_mass(world):
    for name, X_WU in PLACEMENT.units.items():
        close(world.pose3(name), SE3.from_se2(X_WU), 1e-7)
    world.place("a", SE2(1.0, -1.0, 0.3), (0.5, -0.5))
    close(world.pose3("a"), SE3.from_se2(SE2(1.0, -1.0, 0.3)), 1e-7)
    assert world.wheel_angles("a") == pytest.approx((0.5, -0.5))


def test_the_pose_of_a_unit_is_a_new_object_only_when_it_has_moved(world):
    for _ in range(240):
        world.step()
    still, before = world.pose("a"), world.pose("b")
    world.place("b", SE2(0.6, -0.3, 0.4), (0.0, 0.0))
    assert world.pose("a") is still
    assert world.pose("b") is not before
    close(SE3.from_se2(world.pose("b")), SE3.from_se2(SE2(0.6, -0.3, 0.4)), 1e-7)
    for name in world.units:
        world.step()
        X = world.pose3(name)
        np.testing.assert_allclose(world.pose(name).translation, X.p[:2], atol=1e-12)


def test_all_frames_are_where_the_urdf_says(world):
    unit = world.unit("a")
    assert set(unit.links) < set(unit.geometry.frames), "most links are welded"
    for link, X_UL in unit.geometry.frames.items():
        if not link.startswith("wheel"):
            close(world.link_pose("a", link), world.pose3("a") @ X_UL, 1e-6)


def test_a_frame_is_that_of_the_pose_in_space(world):
    """Of a unit that has tipped over as well."""
    for turn in ([0.0, 0.0, 0.0, 1.0], [0.3, -0.2, 0.6, 0.7]):
        body, client = world.unit("a").body, world.client
        turn = (np.array(turn) / np.linalg.norm(turn)).tolist()
        pybullet.resetBasePositionAndOrientation(body, [0.4, -0.7, 0.2], turn, physicsClientId=client)
        for link in ("port_left", "port_rear_marker_left"):
            X_UF = world.unit("a").geometry.frame(link)
            X_WF = world.pose3("a") @ X_UF
            np.testing.assert_allclose(
                world.frame("a", X_UF), [X_WF.p, X_WF.R[:, 0], X_WF.R[:, 1]], atol=1e-12
            )


def test_every_setting_of_the_urdf_reaches_the_physics(world):
    body, client = world.unit("a").body, world.client
    friction = {
        name: pybullet.getDynamicsInfo(body, index, physicsClientId=client)[1]
        for name, index in world.unit("a").links.items()
    }
    assert friction["caster_front"] == friction["caster_rear"] == 0.0
    assert friction["wheel_left"] == friction["wheel_right"] == 1.0
    pins = set(world.unit("a").geometry.pins)
    assert set(friction) - pins == {"base", "wheel_left", "wheel_right", "caster_front", "caster_rear"}
    assert {friction[name] for name in ("base", *pins)} == {0.35}


def test_the_wheels_carry_the_unit(world):
    """The casters must not carry the unit, or the wheels would slip."""
    unit = world.unit("a")
    for _ in range(120):
        world.step()
    contacts = pybullet.getContactPoints(bodyA=unit.body, bodyB=world.floor, physicsClientId=world.client)
    load = sum(point[9] for point in contacts)
    on_wheels = sum(point[9] for point in contacts if point[3] in unit.wheels)
    mass = sum(
        pybullet.getDynamicsInfo(unit.body, index, physicsClientId=world.client)[0]
        for index in unit.links.values()
    )
    assert load == pytest.approx(mass * GRAVITY_MPS2, rel=1e-3)
    assert on_wheels > 0.9 * load


def test_a_unit_stands_still_and_level(world):
    before = world.pose3("a")
    for _ in range(240):
        world.step()
    after = world.pose3("a")
    assert np.linalg.norm(after.p - before.p) < 5e-5
    assert math.degrees(math.acos(min(after.R[2, 2], 1.0))) < 0.01


def test_a_unit_that_does_not_stand_level_pitches_as_the_check_says(tmp_path):
    """What the check of a robot computes from its drawing is what the physics does."""
    text = find_urdf("unit.urdf").read_text()
    ballast = (
        '<inertial><origin xyz="0.05 0 0.05"/><mass value="9"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    )
    head, caster, rest = text.partition('<child link="caster_front"/><origin xyz="')
    x, y, z = map(float, rest[: rest.index('"')].split())
    text = head + caster + f"{x} {y} {z + 0.004}" + rest[rest.index('"') :]
    (tmp_path / "askew.urdf").write_text(
        text.replace('<link name="mast">', f'<link name="mast">{ballast}', 1)
    )
    scene = two_units()
    units = {**scene.units, "a": scene.units["a"].model_copy(update={"urdf": str(tmp_path / "askew.urdf")})}
    scene = scene.model_copy(update={"units": units})
    (says,) = standing_problems(scene.geometry("a"))
    with BulletWorld(scene, PLACEMENT) as world:
        for _ in range(240):
            world.step()
        pitch = math.degrees(math.asin(-world.pose3("a").R[2, 0]))
    assert float(re.search(r"askew by (\S+) deg", says)[1]) == pytest.approx(pitch, abs=0.5)


def test_the_floor_is_not_drawn(world):
    view = pybullet.computeViewMatrix([0, 0, 3], [0, 0, 0], [0, 1, 0])
    lens = pybullet.computeProjectionMatrixFOV(60, 1, 0.1, 5)
    image = pybullet.getCameraImage(
        64, 64, view, lens, renderer=pybullet.ER_TINY_RENDERER, physicsClientId=world.client
    )
    visible = set(np.unique(image[4]))
    assert world.floor not in visible
    assert {-1, world.unit("a").body} <= visible


def test_an_obstacle_appears_at_its_time(world):
    assert set(world.obstacles) == {"post"}
    world.reveal(0.49)
    assert set(world.obstacles) == {"post"}
    world.reveal(0.5)
    assert set(world.obstacles) == {"post", "crate"}
    low, high = pybullet.getAABB(world.obstacles["crate"], physicsClientId=world.client)
    assert high[2] == pytest.approx(0.15, abs=1e-3)
    assert low[2] == pytest.approx(0.0, abs=1e-3)


def test_twist_is_that_of_the_axle(world):
    unit = world.unit("a")
    # A turn about a point 0.1 m to the left: v = w r.
    X_WU, w, r = world.pose3("a"), 0.8, 0.1
    centre = X_WU.p + r * X_WU.R[:, 1]
    p_WI = (X_WU @ unit.X_IU.inverse()).p
    v_WI = np.cross([0, 0, w], p_WI - centre)
    pybullet.resetBaseVelocity(unit.body, v_WI.tolist(), [0, 0, w], physicsClientId=world.client)
    twist = world.twist("a")
    assert (twist.v, twist.w) == pytest.approx((w * r, w))


def test_names_are_checked_and_the_client_is_closed():
    with BulletWorld(two_units(), PLACEMENT) as world:
        client = world.client
        with pytest.raises(UnknownNameError, match="unknown unit 'c'"):
            world.pose("c")
        with pytest.raises(UnknownNameError, match="unknown link 'tow'"):
            world.link_pose("a", "tow")
    assert not pybullet.isConnected(client)
    world.close()  # a second call does nothing


def test_the_client_is_closed_when_building_fails(tmp_path):
    scene = two_units()
    broken = tmp_path / "broken.urdf"
    broken.write_text("no URDF")

    class BrokenTags(TagVisuals):
        def unit_urdf(self, unit):
            return broken

    open_before = sum(pybullet.isConnected(i) for i in range(64))
    with pytest.raises(GeometryError, match=r"unit\.urdf: PyBullet cannot load this URDF"):
        BulletWorld(scene, PLACEMENT, tags=BrokenTags(scene, tmp_path))
    assert sum(pybullet.isConnected(i) for i in range(64)) == open_before
