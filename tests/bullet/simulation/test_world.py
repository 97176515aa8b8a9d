import math
import subprocess
import sys

import numpy as np
import pybullet
import pytest

from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import GRAVITY_MPS2, BulletWorld
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import read_unit
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement

OBSTACLES = {
    "post": {"shape": "cylinder", "radius_m": 0.05, "height_m": 0.2},
    "crate": {"shape": "box", "length_m": 0.2, "width_m": 0.1, "appears_at_s": 0.5},
}
PLACEMENT = Placement(
    {"a": SE2(-0.5, 0.3, 2.0), "b": SE2(0.6, -0.2, -0.7)},
    {"post": SE2(0.0, 1.0, 0.0), "crate": SE2(0.0, -1.0, 0.5)},
)


@pytest.fixture
def world(two_units):
    with BulletWorld(two_units(obstacles=OBSTACLES), PLACEMENT) as world:
        yield world


def close(X, Y, tol=1e-9):
    np.testing.assert_allclose(X.R, Y.R, atol=tol)
    np.testing.assert_allclose(X.p, Y.p, atol=tol)


def test_units_stand_where_they_are_placed_not_their_centres_of_mass(world):
    for name, X_WU in PLACEMENT.units.items():
        close(world.pose3(name), SE3.from_se2(X_WU), 1e-7)
    world.place("a", SE2(1.0, -1.0, 0.3), (0.5, -0.5))
    close(world.pose3("a"), SE3.from_se2(SE2(1.0, -1.0, 0.3)), 1e-7)
    assert world.wheel_angles("a") == pytest.approx((0.5, -0.5))


def test_all_named_frames_lie_where_the_urdf_says(world):
    unit = world.unit("a")
    assert set(unit.links) < set(unit.geometry.frames), "most of them are welded"
    for link, X_UL in unit.geometry.frames.items():
        if not link.startswith("wheel"):
            close(world.link_pose("a", link), world.pose3("a") @ X_UL, 1e-6)


def test_every_setting_of_the_urdf_reaches_the_physics(world):
    body, client = world.unit("a").body, world.client
    friction = {
        name: pybullet.getDynamicsInfo(body, index, physicsClientId=client)[1]
        for name, index in world.unit("a").links.items()
    }
    assert friction["caster_front"] == friction["caster_rear"] == 0.0
    assert friction["wheel_left"] == friction["wheel_right"] == 1.0
    mechanism = set(world.unit("a").geometry.mechanism)
    assert set(friction) - mechanism == {"base", "wheel_left", "wheel_right", "caster_front", "caster_rear"}
    assert {friction[name] for name in ("base", *mechanism)} == {0.35}


def test_the_wheels_carry_the_unit(world):
    """Four points of contact share the load as the solver pleases; on the casters the wheels would slip."""
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


def test_the_floor_is_not_drawn(world):
    view = pybullet.computeViewMatrix([0, 0, 3], [0, 0, 0], [0, 1, 0])
    lens = pybullet.computeProjectionMatrixFOV(60, 1, 0.1, 5)
    image = pybullet.getCameraImage(
        64, 64, view, lens, renderer=pybullet.ER_TINY_RENDERER, physicsClientId=world.client
    )
    seen = set(np.unique(image[4]))
    assert world.floor not in seen
    assert {-1, world.unit("a").body} <= seen


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
    # Turning on the spot about a point 0.1 m to the left: v = w r.
    X_WU, w, r = world.pose3("a"), 0.8, 0.1
    centre = X_WU.p + r * X_WU.R[:, 1]
    p_WI = (X_WU @ unit.X_IU.inverse()).p
    v_WI = np.cross([0, 0, w], p_WI - centre)
    pybullet.resetBaseVelocity(unit.body, v_WI.tolist(), [0, 0, w], physicsClientId=world.client)
    twist = world.twist("a")
    assert (twist.v, twist.w) == pytest.approx((w * r, w))


def test_names_are_checked_and_the_client_is_given_back(two_units):
    with BulletWorld(two_units(), PLACEMENT) as world:
        client = world.client
        with pytest.raises(UnknownNameError, match="unknown unit 'c'"):
            world.pose("c")
        with pytest.raises(UnknownNameError, match="unknown link 'tow'"):
            world.link_pose("a", "tow")
    assert not pybullet.isConnected(client)
    world.close()  # once more does no harm


def test_the_client_is_given_back_when_building_fails(two_units, tmp_path):
    scene = two_units()
    broken = tmp_path / "broken.urdf"
    broken.write_text(read_unit.__module__)

    class BrokenTags(TagVisuals):
        def unit_urdf(self, unit):
            return broken

    open_before = sum(pybullet.isConnected(i) for i in range(64))
    with pytest.raises(Exception, match="cannot load this URDF"):
        BulletWorld(scene, PLACEMENT, tags=BrokenTags(scene, tmp_path))
    assert sum(pybullet.isConnected(i) for i in range(64)) == open_before


PROGRAM = """
import hashlib, struct, sys
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.tagged_bodies import TagVisuals
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.scene import Scene
from msrr_scenes.geometry.se2 import SE2
scene = Scene.model_validate({"name": "t", "units": {"a": {"number": 1}, "b": {"number": 2}},
                              "plan": [{"unit": "a", "to": "b.rear"}]})
X_DP = SE2(-0.03, 0.006, -0.05)
X_WA = scene.geometry("b").dock_frame("rear") @ X_DP @ scene.geometry("a").port("front").inverse()
digest = hashlib.sha256()
with BulletWorld(scene, Placement({"a": X_WA, "b": SE2()}, {})) as world:
    plant = BulletPlant(world)
    plant.begin_dock(scene.plan[0])
    plant.command("a", Twist(0.08, 0.05))
    for k in range(480):
        plant.step()
        if k == 300:
            plant.set_lock("a", True)
        for unit in "ab":
            X = plant.pose(unit)
            digest.update(struct.pack("5d", X.x, X.y, X.yaw, *plant.wheel_angles(unit)))
        digest.update(repr((plant.switches("a"), plant.pins_touch("a"))).encode())
print(digest.hexdigest(), file=sys.stderr)
"""


def test_the_same_commands_give_the_same_bits_in_another_process():
    """Contact, funnel and lock included."""
    runs = [
        subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True).stderr
        for _ in range(2)
    ]
    assert len(runs[0].split()[-1]) == 64
    assert runs[0].split()[-1] == runs[1].split()[-1]


def test_a_unit_stops_at_an_obstacle(two_units):
    from msrr_bullet.simulation.bullet_plant import BulletPlant

    scene = two_units(obstacles={"post": {"shape": "cylinder", "radius_m": 0.05}})
    placement = Placement({"a": SE2(), "b": SE2(0.0, 2.0, 0.0)}, {"post": SE2(0.25, 0.0, 0.0)})
    with BulletWorld(scene, placement) as world:
        plant = BulletPlant(world)
        plant.command("a", Twist(0.1, 0.0))
        for _ in range(360):
            plant.step()
        # The post stands between the pins; the inner edges of their tips, y = 0.035, meet it first.
        meets = 0.25 - math.sqrt(0.05**2 - 0.035**2) - 0.118
        assert plant.pose("a").x == pytest.approx(meets, abs=1e-3)
