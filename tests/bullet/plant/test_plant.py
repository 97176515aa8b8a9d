import math

import numpy as np
import pytest

from msrr_bullet.plant.kinematic_plant import KinematicPlant
from msrr_bullet.plant.kinematic_port import CaptureRange
from msrr_bullet.plant.plant import Plant, tick_ns
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement
from msrr_scenes.random_streams import stream

PLANTS = ("bullet", "unicycle")


@pytest.mark.parametrize("kind", PLANTS)
@pytest.mark.parametrize("port", ["rear", "left", "right"])
def test_every_passive_port_can_be_docked_to(bench, kind, port):
    with bench(kind, SE2(-0.03, 0.0, 0.0), port) as b:
        plant: Plant = b.plant
        b.dock()
        assert plant.switches("a") == (True, True)
        assert plant.lock_engaged("a")
        assert plant.pins_touch("a")
        assert abs(b.gap) < 2e-4  # the faces meet
        assert abs(b.X_DP().y) < 1.6e-3
        assert plant.pull_test("a").holds


@pytest.mark.parametrize("kind", PLANTS)
def test_the_funnel_draws_in_10_mm_and_6_degrees(bench, kind):
    """The corners of the tolerance, at pressing and at docking speed, and the middle of its edges."""
    lateral, yaw = 0.010, math.radians(6.0)
    for k, (i, j) in enumerate([(1, 0), (0, 1), (1, 1), (1, -1)]):
        with bench(kind, SE2(-0.025, i * lateral, j * yaw), ("rear", "left")[k % 2]) as b:
            b.drive((0.05, 0.11)[k // 2], 2.0, until_seated=True)
            assert b.plant.switches("a") == (True, True), (i, j)


def test_any_approach_within_the_tolerance_seats(bench):
    """Eight random ones; on the bench 40 of 40 did."""
    rng = stream(7, "approach")
    for _ in range(8):
        lateral, yaw = rng.uniform(-0.01, 0.01), math.radians(rng.uniform(-6.0, 6.0))
        port = str(rng.choice(["rear", "left", "right"]))
        with bench("bullet", SE2(-0.025, lateral, yaw), port) as b:
            b.drive(0.08, 2.0, until_seated=True)
            assert b.plant.switches("a") == (True, True), (port, lateral, yaw)


@pytest.mark.parametrize("kind", PLANTS)
@pytest.mark.parametrize("lateral_mm", [17.0, -20.0, 25.0])
def test_beyond_the_mouth_the_pins_jam(bench, kind, lateral_mm):
    with bench(kind, SE2(-0.025, lateral_mm / 1e3, 0.0)) as b:
        b.drive(0.05, 2.0)
        assert b.plant.pins_touch("a")
        assert b.plant.switches("a") == (False, False)
        assert b.gap == pytest.approx(0.018, abs=5e-4)
        b.drive(-0.1, 0.8)  # and it gets free again
        assert b.gap > 0.05
        assert not b.plant.pins_touch("a")


def test_the_docked_unit_is_not_dragged_away(bench):
    """Pressed by a unit whose wheels give all they can: from behind, where it is weakest, and from a side."""
    for port in ("rear", "left"):
        with bench("bullet", SE2(-0.02, 0.0, 0.0), port) as b:
            start = b.plant.pose("b")
            b.drive(0.1, 0.5)
            hit = b.plant.pose("b")
            b.drive(0.1, 1.0)
            pressed = hit.inverse() @ b.plant.pose("b")
            assert np.hypot(*(start.inverse() @ hit).translation) < 4e-3, port  # the blow of 0.1 m/s
            assert np.hypot(*pressed.translation) < 5e-4, port
            assert abs(pressed.yaw) < math.radians(0.1)


def test_well_aligned_pins_touch_when_they_reach_the_switches(bench):
    with bench("bullet", SE2(-0.03, 0.0, 0.0)) as b:
        while not b.plant.pins_touch("a"):
            b.drive(0.05, 0.02)
            assert b.plant.tick < 480
        assert b.gap < 2e-3


@pytest.mark.parametrize("kind", PLANTS)
def test_time_is_counted_in_whole_ticks(bench, kind):
    with bench(kind, SE2(-0.3, 0.0, 0.0)) as b:
        assert (b.plant.tick, b.plant.now_ns()) == (0, 0)
        for _ in range(7):
            b.plant.step()
        assert (b.plant.tick, b.plant.now_ns()) == (7, round(7e9 / 240))
    assert tick_ns(240 * 3600, 240.0) == 3600 * 10**9


def test_a_unicycle_moves_on_exact_arcs(two_units):
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


def test_both_plants_drive_alike(bench):
    """Away from contact PyBullet's unit stays within millimetres of the ideal one."""
    ends = []
    for kind in PLANTS:
        with bench(kind, SE2(-0.6, 0.1, 0.4)) as b:
            for v, w in ((0.2, 0.5), (0.3, -1.0), (-0.1, 0.3)):
                b.plant.command("a", Twist(v, w))
                for _ in range(120):
                    b.plant.step()
            ends.append(b.plant.pose("a"))
    apart = ends[0].inverse() @ ends[1]
    assert math.hypot(apart.x, apart.y) < 2e-3
    assert abs(apart.yaw) < math.radians(0.3)


def test_a_world_follows_the_unicycles(two_units, before_port):
    scene = two_units()
    with BulletWorld(scene, before_port(scene, SE2(-0.3, 0.02, 0.1))) as world:
        plant = KinematicPlant(scene, before_port(scene, SE2(-0.3, 0.02, 0.1)), world)
        plant.command("a", Twist(0.2, 0.3))
        for _ in range(60):
            plant.step()
        seen, told = world.pose("a"), plant.pose("a")
        np.testing.assert_allclose(seen.as_array(), told.as_array(), atol=1e-7)
        assert world.wheel_angles("a") == pytest.approx(plant.wheel_angles("a"))


def test_a_locked_unicycle_follows_the_unit_it_is_locked_to(bench):
    with bench("unicycle", SE2(-0.02, 0.001, 0.0)) as b:
        b.dock()
        before = b.X_DP()
        b.plant.command("b", Twist(0.2, 0.5))
        b.drive(0.0, 1.0)
        after = b.X_DP()
        np.testing.assert_allclose(after.as_array(), before.as_array(), atol=1e-3)


def test_the_capture_of_an_ideal_port_is_what_it_is_told(two_units, before_port):
    scene = two_units()
    for capture, seats in ((CaptureRange(0.02, 0.1, 0.001), True), (CaptureRange(0.01, 0.1, 0.001), False)):
        plant = KinematicPlant(scene, before_port(scene, SE2(-0.03, 0.015, 0.0)), capture=capture)
        plant.begin_dock(scene.plan[0])
        plant.command("a", Twist(0.1, 0.0))
        for _ in range(240):
            plant.step()
        assert plant.switches("a") == (seats, seats)
