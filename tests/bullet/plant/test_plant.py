"""Behaviour that both plants have in common: time, drives, docking, locks and misuse."""

import math

import pytest

from msrr_bullet.plant.plant import Plant, tick_ns
from msrr_scenes.errors import MsrrError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LockPosition, Twist
from tests.bullet.conftest import bench

PLANTS = ("bullet", "unicycle")
BEFORE = SE2(-0.025, 0.0, 0.0)
#: A start pose from which the seated unit leans against the play of the pins.
ASKEW = SE2(-0.025, 0.005, math.radians(-3.0))


@pytest.mark.parametrize("kind", PLANTS)
@pytest.mark.parametrize("port", ["rear", "left", "right"])
def test_every_passive_port_can_be_docked_to(kind, port):
    with bench(kind, SE2(-0.03, 0.0, 0.0), port) as b:
        plant: Plant = b.plant
        b.dock()
        assert plant.switches("a") == (True, True)
        assert plant.lock_engaged("a")
        assert plant.pins_touch("a")
        assert abs(b.gap) < 2e-4  # the faces meet
        assert abs(b.X_DP().y) < 1.6e-3
        assert plant.pull_test("a")


@pytest.mark.parametrize("kind", PLANTS)
def test_the_funnel_draws_in_10_mm_and_6_degrees(kind):
    """The corners of the tolerance, at pressing and at docking speed, and the middle of its edges."""
    lateral, yaw = 0.010, math.radians(6.0)
    for k, (i, j) in enumerate([(1, 0), (0, 1), (1, 1), (1, -1)]):
        with bench(kind, SE2(-0.025, i * lateral, j * yaw), ("rear", "left")[k % 2]) as b:
            b.drive((0.05, 0.11)[k // 2], 2.0, until_seated=True)
            assert b.plant.switches("a") == (True, True), (i, j)


@pytest.mark.parametrize("kind", PLANTS)
@pytest.mark.parametrize("lateral_mm", [17.0, -20.0, 25.0])
def test_beyond_the_mouth_the_pins_jam(kind, lateral_mm):
    with bench(kind, SE2(-0.025, lateral_mm / 1e3, 0.0)) as b:
        b.drive(0.05, 2.0)
        assert b.plant.pins_touch("a")
        assert b.plant.switches("a") == (False, False)
        assert b.gap == pytest.approx(0.018, abs=5e-4)
        b.drive(-0.1, 0.8)  # and it can back out
        assert b.gap > 0.05
        assert not b.plant.pins_touch("a")


@pytest.mark.parametrize("kind", PLANTS)
def test_time_is_counted_in_whole_ticks(kind):
    with bench(kind, SE2(-0.3, 0.0, 0.0)) as b:
        assert (b.plant.tick, b.plant.now_ns()) == (0, 0)
        for _ in range(7):
            b.plant.step()
        assert (b.plant.tick, b.plant.now_ns()) == (7, round(7e9 / 240))
    assert tick_ns(240 * 3600, 240.0) == 3600 * 10**9


@pytest.mark.parametrize("kind", PLANTS)
def test_a_seized_drive_holds_its_wheels_and_others_turn(kind):
    faults = [{"kind": "unit_seized", "unit": "a", "from_s": 1.0}]
    with bench(kind, SE2(-0.3, 0.0, 0.0), faults=faults) as b:
        b.plant.command("b", Twist(0.1, 0.0))
        b.drive(-0.1, 1.0)
        assert b.plant.wheel_angles("a")[0] < -1.0  # it drove until then
        b.drive(-0.1, 0.2)
        before, other = b.plant.pose("a"), b.plant.pose("b")
        angles = b.plant.wheel_angles("a")
        for v, w in ((-0.1, 0.0), (0.2, 0.5)):
            b.plant.command("a", Twist(v, w))
            for _ in range(120):
                b.plant.step()
        moved = before.inverse() @ b.plant.pose("a")
        assert math.hypot(moved.x, moved.y) < 1e-4
        assert b.plant.wheel_angles("a") == pytest.approx(angles, abs=1e-3)
        assert math.dist(other.translation, b.plant.pose("b").translation) > 0.05


def test_both_plants_drive_alike():
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


@pytest.mark.parametrize("kind", PLANTS)
def test_a_seated_unit_is_locked_and_holds_the_pull(kind):
    with bench(kind, ASKEW) as b:
        plant = b.plant
        assert plant.lock_position("a") is LockPosition.OPEN
        b.drive(0.05, 2.0, until_seated=True)
        assert plant.switches("a") == (True, True)
        plant.set_lock("a", True)
        b.drive(0.05, 0.4)
        assert plant.lock_position("a") is LockPosition.CLOSING
        assert not plant.lock_engaged("a")
        b.drive(0.05, 0.2)
        assert plant.lock_position("a") is LockPosition.CLOSED
        assert plant.lock_engaged("a")
        before = b.gap
        assert plant.pull_test("a")
        assert b.gap - before < 1e-4
        assert plant.lock_engaged("a")


@pytest.mark.parametrize("kind", PLANTS)
@pytest.mark.parametrize("pull_n", [5.0, 60.0])
@pytest.mark.parametrize(("share", "holds"), [(0.99, True), (1.0, False), (1.01, False)])
def test_the_strength_of_the_lock_is_exact_to_one_percent(kind, pull_n, share, holds):
    """The tension in the constraint is the pull alone; wheels and contact carry no part of it.

    The target stands in a heading that is no axis of the world.
    """
    with bench(kind, BEFORE, lock={"strength_n": pull_n / share, "pull_force_n": pull_n}) as b:
        b.dock()
        b.drive(0.0, 0.3)
        assert b.plant.lock_engaged("a")
        assert b.plant.pull_test("a") is holds
        assert b.plant.lock_engaged("a") is holds
        assert b.plant.lock_position("a") is LockPosition.CLOSED  # the actuator does not notice


@pytest.mark.parametrize("kind", PLANTS)
def test_the_pull_test_detects_an_open_lock(kind):
    with bench(kind, BEFORE) as b:
        b.drive(0.05, 2.0, until_seated=True)
        assert not b.plant.pull_test("a")


@pytest.mark.parametrize("kind", PLANTS)
def test_a_lock_that_closes_on_half_seated_pins_reports_closed_and_holds_nothing(kind):
    with bench(kind, SE2(-0.006, 0.0, 0.0)) as b:
        b.drive(0.0, 0.1)
        b.plant.set_lock("a", True)
        b.drive(0.0, 0.6)
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        assert b.plant.switches("a") == (False, False)
        assert not b.plant.lock_engaged("a")
        assert not b.plant.pull_test("a")


@pytest.mark.parametrize("kind", PLANTS)
def test_a_locked_unit_cannot_drive_off_and_an_unlocked_one_backs_out(kind):
    with bench(kind, ASKEW) as b:
        b.dock()
        b.drive(-0.2, 0.8)
        assert abs(b.gap) < 3e-4
        assert b.plant.lock_engaged("a")
        b.drive(0.0, 0.8)
        b.plant.set_lock("a", False)
        assert b.plant.lock_position("a") is LockPosition.OPEN
        b.drive(0.0, 0.1)
        assert abs(b.gap) < 5e-4  # opening does not throw the units apart
        b.drive(-0.1, 1.0)
        assert b.gap > 0.07
        assert abs(b.X_DP().yaw) < math.radians(1.0)
        assert b.plant.switches("a") == (False, False)
        # Contact between the ports is restored, and the lock works a second time.
        b.dock(v=0.08)
        assert abs(b.gap) < 5e-4
        assert b.plant.pull_test("a")


@pytest.mark.parametrize("kind", PLANTS)
def test_a_unit_may_dock_again_as_soon_as_its_lock_is_open(kind):
    """Contact of the parting pair is restored although the unit has a new mechanism."""
    with bench(kind, BEFORE) as b:
        b.dock()
        b.plant.set_lock("a", False)
        b.plant.begin_dock(b.scene.plan[0])
        b.drive(-0.1, 0.8)
        assert b.gap > 0.03
        b.dock()
        assert abs(b.gap) < 5e-4  # the faces stop the unit
        assert b.plant.lock_engaged("a")


@pytest.mark.parametrize("kind", PLANTS)
def test_a_plug_keeps_the_pins_from_the_seat_until_it_is_removed(kind):
    with bench(kind, BEFORE) as b:
        b.plant.set_plug("b", "rear", True)
        b.plant.set_plug("b", "rear", True)  # a second call changes nothing
        b.drive(0.05, 1.5)
        assert b.gap > 0.008
        assert b.plant.switches("a") == (False, False)
        assert b.plant.pins_touch("a")
        b.plant.set_plug("b", "rear", False)
        b.plant.set_plug("b", "rear", False)
        b.drive(0.05, 1.0)
        assert b.plant.switches("a") == (True, True)


@pytest.mark.parametrize("kind", PLANTS)
def test_misuse_is_refused_by_name(kind):
    with bench(kind, BEFORE) as b:
        with pytest.raises(MsrrError, match="'b' has no docking target"):
            b.plant.set_lock("b", True)
        with pytest.raises(UnknownNameError, match="unknown unit 'c'"):
            b.plant.command("c", Twist())
        assert b.plant.switches("b") == (False, False)
        assert b.plant.lock_position("b") is LockPosition.OPEN
        b.dock()
        with pytest.raises(MsrrError, match="still locked"):
            b.plant.begin_dock(b.scene.plan[0])
