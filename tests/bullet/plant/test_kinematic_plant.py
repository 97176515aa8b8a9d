"""The plant without contact: exact kinematics, the funnel, and the bodies that follow for the cameras."""

from pathlib import Path

import numpy as np
import pytest

from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from tests.bullet.conftest import before_port, bench, two_units


def test_a_unicycle_moves_on_exact_arcs():
    scene = two_units(limits={"a_max_mps2": 1e6, "dw_max_radps2": 1e6, "kappa_per_s": 1e6})
    plant = KinematicPlant(scene, Placement({"a": SE2(0.1, 0.2, 0.3), "b": SE2(2, 2, 0)}, {}))
    plant.command("a", Twist(0.2, 0.7))
    for _ in range(480):
        plant.step()
    expected = SE2(0.1, 0.2, 0.3) @ SE2.exp(0.4, 0.0, 1.4)
    np.testing.assert_allclose(plant.pose("a").as_array(), expected.as_array(), atol=1e-9)
    assert plant.twist("a").v == pytest.approx(0.2)
    left, right = plant.wheel_angles("a")
    assert 0.033 * (left + right) / 2 == pytest.approx(0.4)
    assert 0.033 * (right - left) / 0.13 == pytest.approx(1.4)


def test_a_world_follows_the_unicycles():
    scene = two_units()
    with BulletWorld(scene, before_port(scene, SE2(-0.3, 0.02, 0.1))) as world:
        plant = KinematicPlant(scene, before_port(scene, SE2(-0.3, 0.02, 0.1)), world)
        plant.command("a", Twist(0.2, 0.3))
        for _ in range(60):
            plant.step()
        np.testing.assert_allclose(world.pose("a").as_array(), plant.pose("a").as_array(), atol=1e-7)
        assert world.wheel_angles("a") == pytest.approx(plant.wheel_angles("a"))


def test_a_locked_unicycle_follows_the_unit_it_is_locked_to():
    with bench("unicycle", SE2(-0.02, 0.001, 0.0)) as b:
        b.dock()
        before = b.X_DP()
        b.plant.command("b", Twist(0.2, 0.5))
        b.drive(0.0, 1.0)
        after = b.X_DP()
        np.testing.assert_allclose(after.as_array(), before.as_array(), atol=1e-3)


def test_no_file_is_looked_for_while_the_units_move(monkeypatch):
    """However many ticks and units: files are found when the plant is built."""
    scene = two_units()
    looked_for = []

    def counted(self):
        looked_for.append(self)
        return is_file(self)

    is_file = Path.is_file
    monkeypatch.setattr(Path, "is_file", counted)
    plant = KinematicPlant(scene, before_port(scene, SE2(-0.02, 0.001, 0.0)))
    assert looked_for, "the count counts"
    plant.begin_dock(scene.plan[0])
    looked_for.clear()
    plant.command("a", Twist(0.1, 0.0))
    for _ in range(50):
        plant.step()
    assert looked_for == []


def test_the_funnel_captures_up_to_a_lateral_error_of_13_mm():
    scene = two_units()
    for lateral, seats in ((0.0129, True), (0.0131, False)):
        plant = KinematicPlant(scene, before_port(scene, SE2(-0.03, lateral, 0.0)))
        plant.begin_dock(scene.plan[0])
        plant.command("a", Twist(0.1, 0.0))
        for _ in range(240):
            plant.step()
        assert plant.switches("a") == (seats, seats)
