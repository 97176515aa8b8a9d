"""The wheel motors: speeds, torque, and wheels that are released or held."""

import math

import pybullet
import pytest

from msrr_bullet.plant.limited_drive import wheel_speeds
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.wheel_motors import WheelMotors
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from tests.bullet.conftest import two_units

PLACEMENT = Placement({"a": SE2(0.2, 0.1, 0.7), "b": SE2(3.0, 3.0, 0.0)}, {})


@pytest.mark.parametrize(
    ("v", "w"), [(0.3, 0.0), (0.1, 0.0), (-0.2, 0.0), (0.0, 1.2), (0.0, -0.3), (0.2, 0.8), (0.3, -1.4)]
)
def test_a_unit_moves_as_its_kinematics_say(v, w):
    """Straight lines are straight, and the yaw rate is that of rolling wheels to 1 %."""
    scene = two_units()
    hz = int(scene.physics_hz)
    with BulletWorld(scene, PLACEMENT) as world:
        plant = BulletPlant(world)
        plant.command("a", Twist(v, w))
        for _ in range(hz):
            plant.step()
        X_0, wheels_0 = plant.pose("a"), plant.wheel_angles("a")
        for _ in range(hz):
            plant.step()
        step = (X_0.inverse() @ plant.pose("a")).log()
        twist = plant.twist("a")
        turned = [b - a for a, b in zip(wheels_0, plant.wheel_angles("a"), strict=True)]
        left, right = wheel_speeds(Twist(v, w), scene.geometry("a"))
    assert step[0] == pytest.approx(v, rel=0.01, abs=1e-4)
    assert step[1] == pytest.approx(0.0, abs=5e-3 * max(abs(v), 0.1))
    assert step[2] == pytest.approx(w, rel=0.01, abs=1e-3)
    assert turned == pytest.approx([left, right], rel=0.01, abs=1e-3)
    assert (twist.v, twist.w) == pytest.approx((v, w), rel=0.01, abs=1e-3)


def test_a_weak_motor_accelerates_slowly():
    """With 3 mN m on each wheel, 2 T / r accelerates about 2.8 kg by 0.065 m/s2."""
    weak = two_units(motors={"torque_nm": 0.003})
    with BulletWorld(weak, PLACEMENT) as world:
        motors = WheelMotors(world.client, world.unit("a"), weak.motors)
        motors.drive(wheel_speeds(Twist(0.3, 0.0), weak.geometry("a")))
        for _ in range(240):
            world.step()
        assert 0.04 < world.twist("a").v < 0.08


def test_released_wheels_roll_and_held_wheels_do_not():
    scene = two_units()
    for release, moved in ((True, 0.05), (False, 0.0)):
        with BulletWorld(scene, PLACEMENT) as world:
            motors = WheelMotors(world.client, world.unit("a"), scene.motors)
            if release:
                motors.release()
            world.place("a", SE2(), (0.0, 0.0))
            push(world, 5.0, 120)
            x = world.pose("a").x
        assert (x > moved) if release else math.isclose(x, moved, abs_tol=2e-4)


def push(world, force, ticks):
    for _ in range(ticks):
        pybullet.applyExternalForce(
            world.unit("a").body,
            -1,
            [force, 0, 0],
            world.pose3("a").p.tolist(),
            pybullet.WORLD_FRAME,
            physicsClientId=world.client,
        )
        world.step()
