"""The floor as it was built: friction, slope and ridges."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pybullet
import pytest

from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.floor import GRAVITY_MPS2, gravity
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.as_built import BuiltFloor, draw_as_built
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import urdf_folder
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement

PLACEMENT = Placement({"a": SE2(-0.6, 0.1, 0.0), "b": SE2(1.5, -1.0, 0.0)}, {})


def open_world(floor: str, **overrides: str) -> BulletWorld:
    scene = load_scene("close_range", {"as_built": f"{{floor: {floor}}}", **overrides})
    return BulletWorld(scene, PLACEMENT, built=draw_as_built(scene, 0))


def test_gravity_leans_by_the_slope_and_keeps_its_size() -> None:
    assert gravity(BuiltFloor()) == (0.0, 0.0, -GRAVITY_MPS2)
    g = np.array(gravity(BuiltFloor(slope=(math.radians(3.0), math.radians(-4.0)))))
    assert float(np.linalg.norm(g)) == pytest.approx(GRAVITY_MPS2)
    assert math.degrees(math.atan2(g[0], g[2])) == pytest.approx(-177.0)
    assert math.degrees(math.atan2(g[1], -g[2])) == pytest.approx(4.0)


def test_a_unit_with_free_wheels_rolls_down_the_slope() -> None:
    """It gains less than g sin(3 deg) = 0.51 m/s in a second, because its wheels have inertia."""
    with open_world("{slope_x_deg: 3}") as world:
        plant = BulletPlant(world)
        for _ in range(240):
            plant.step_freewheeling()
        assert -0.51 < plant.twist("a").v < -0.4


@pytest.mark.parametrize("slope_deg", [0.1, 1.5, 3.0])
def test_a_unit_that_stands_stays_where_it_is_on_a_slope(slope_deg: float) -> None:
    """Its gear holds the wheels: it must not creep, however slowly, as a solver that stops early lets it."""
    with open_world(f"{{slope_x_deg: {slope_deg}, friction_percent: -50}}") as world:
        plant = BulletPlant(world)
        start = plant.pose("a")
        for _ in range(240 * 10):
            plant.step()
        assert plant.is_asleep("a")
        moved = start.inverse() @ plant.pose("a")
    assert math.hypot(moved.x, moved.y) < 3e-4
    assert abs(moved.yaw) < math.radians(0.01)


def test_wheels_slip_on_a_floor_with_less_friction() -> None:
    """With a tenth of the friction no unit brakes at 2 m/s^2; the drawn floor holds it."""
    way = []
    for floor in ("{}", "{friction_percent: -90}"):
        with open_world(floor) as world:
            plant = BulletPlant(world)
            plant.command("a", Twist(0.4, 0.0))
            for _ in range(960):
                plant.step()
            x = plant.pose("a").x
            for motor in plant._motors.values():
                motor.drive((0.0, 0.0), held=True)
            for _ in range(120):
                world.step()
            way.append(world.pose("a").x - x)
    assert way[0] < 0.03
    assert way[1] > 2.0 * way[0]


def test_a_unit_climbs_over_ridges_at_every_joint() -> None:
    """It is lifted at two joints or three, half a metre apart, and gets across."""
    with open_world("{ridge_m: 0.002}") as world:
        plant = BulletPlant(world)
        plant.command("a", Twist(0.3, 0.0))
        heights = []
        for _ in range(1200):
            plant.step()
            heights.append((plant.pose("a").x, plant.pose3("a").p[2]))
        x, z = np.array(heights).T
    assert x[-1] > 0.4
    lifted = np.unique(np.round(x[z > 0.0015] / 0.5, 1))
    assert z.max() < 0.006
    assert len(lifted) >= 2


@pytest.mark.parametrize("springs", [False, True])
def test_casters_that_give_way_leave_the_wheels_on_the_floor_at_a_ridge(
    springs: bool, tmp_path: Path
) -> None:
    """The rigid ones of the shipped unit are level with its wheels and lift them."""
    urdf, rigid = (urdf_folder() / "unit.urdf").read_text(), '<lateral_friction value="0"/>'
    assert urdf.count(rigid) == 2
    if springs:
        urdf = urdf.replace(rigid, rigid + '<stiffness value="10000"/><damping value="100"/>')
    (tmp_path / "own.urdf").write_text(urdf)
    with open_world("{ridge_m: 0.001}", **{"units.a.urdf": str(tmp_path / "own.urdf")}) as world:
        plant = BulletPlant(world)
        loads = []
        for tick in range(900):
            plant.command("a", Twist(0.3, 0.0 if tick < 480 else 0.5))
            plant.step()
            loads.append(_wheel_load_n(world, "a"))
    assert (min(loads) > 5.0) == springs
    assert float(np.median(loads)) == pytest.approx(2.87 * GRAVITY_MPS2, rel=0.1)


def _wheel_load_n(world: BulletWorld, name: str) -> float:
    unit = world.units[name]
    contacts = pybullet.getContactPoints(bodyA=unit.body, physicsClientId=world.client)
    return sum(float(contact[9]) for contact in contacts if contact[3] in unit.wheels)


def test_a_level_floor_has_no_ridges() -> None:
    with open_world("{}") as even, open_world("{ridge_m: 0.001}") as ridged:
        counts = [pybullet.getNumBodies(physicsClientId=world.client) for world in (even, ridged)]
    arena = even.scene.arena
    expected = sum(math.floor((high - low) / 0.5) for low, high in (arena.x_m, arena.y_m))
    assert counts[0] == 3
    assert expected <= counts[1] - counts[0] <= expected + 2
