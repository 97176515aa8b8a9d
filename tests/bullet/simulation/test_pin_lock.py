import math

import pytest

from msrr_bullet.plant.lock_actuator import PULL_SLACK, LockActuator
from msrr_bullet.plant.plant import NoDockError
from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import GeometryError, MsrrError, UnknownNameError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LockPosition, Twist

BEFORE = SE2(-0.025, 0.0, 0.0)
#: A little off, so that the seated unit leans against its play: the lock must take it as it is.
ASKEW = SE2(-0.025, 0.005, math.radians(-3.0))
PLANTS = ("bullet", "unicycle")


@pytest.mark.parametrize("kind", PLANTS)
def test_a_seated_unit_is_locked_and_holds_the_pull(bench, kind):
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
        result = plant.pull_test("a")
        assert result.holds
        assert result.displacement_m < 1e-4
        assert result.force_n == b.scene.lock.pull_force_n
        assert plant.lock_engaged("a")


@pytest.mark.parametrize("kind", PLANTS)
@pytest.mark.parametrize(("strength_n", "holds"), [(8.0, False), (24.0, False), (26.0, True)])
def test_the_pull_finds_out_a_weak_lock(bench, kind, strength_n, holds):
    """In a heading that is no axis of the world; the lock's strength does not depend on it."""
    with bench(kind, BEFORE, lock={"strength_n": strength_n, "pull_force_n": 25.0}) as b:
        b.dock()
        b.drive(0.0, 0.3)
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        result = b.plant.pull_test("a")
        assert result.holds is holds
        assert b.plant.lock_engaged("a") is holds
        assert b.plant.lock_position("a") is LockPosition.CLOSED  # the cam knows nothing of it
        assert (result.displacement_m >= PULL_SLACK) is not holds


@pytest.mark.parametrize("kind", PLANTS)
@pytest.mark.parametrize("pull_n", [5.0, 60.0])
@pytest.mark.parametrize(("share", "holds"), [(0.99, True), (1.01, False)])
def test_the_lock_is_as_strong_as_told_to_a_hundredth(bench, kind, pull_n, share, holds):
    """The constraint's tension is the pull and nothing else: wheels and contact carry no part of it."""
    with bench(kind, BEFORE, lock={"strength_n": pull_n / share, "pull_force_n": pull_n}) as b:
        b.dock()
        b.drive(0.0, 0.3)
        assert b.plant.lock_engaged("a")
        assert b.plant.pull_test("a").holds is holds


@pytest.mark.parametrize("kind", PLANTS)
def test_the_pull_finds_out_an_unlocked_unit(bench, kind):
    with bench(kind, BEFORE) as b:
        b.drive(0.05, 2.0, until_seated=True)
        assert not b.plant.pull_test("a").holds


@pytest.mark.parametrize("kind", PLANTS)
def test_a_cam_that_closes_on_half_seated_pins_says_closed_and_holds_nothing(bench, kind):
    with bench(kind, SE2(-0.006, 0.0, 0.0)) as b:
        b.drive(0.0, 0.1)
        b.plant.set_lock("a", True)
        b.drive(0.0, 0.6)
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        assert b.plant.switches("a") == (False, False)
        assert not b.plant.lock_engaged("a")
        assert not b.plant.pull_test("a").holds


@pytest.mark.parametrize(("gap_m", "holds"), [(0.0018, True), (0.0022, False)])
def test_the_cam_catches_pins_that_are_in_its_reach(bench, gap_m, holds):
    """A seated pin ends half a millimetre before the bottom of its hole; the cam reaches 2.5 mm."""
    with bench("bullet", SE2(-gap_m, 0.0, 0.0), lock={"close_time_s": 0.05}) as b:
        b.plant.set_lock("a", True)
        b.drive(0.0, 0.1)
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        assert b.plant.lock_engaged("a") is holds


@pytest.mark.parametrize(("yaw_deg", "switches"), [(2.0, (False, True)), (-2.0, (True, False))])
def test_one_pin_in_reach_is_not_held(bench, yaw_deg, switches):
    """The unit stands askew before its seat: one pin is deep enough for its switch, the other is not."""
    with bench("bullet", SE2(-0.0023, 0.0, math.radians(yaw_deg)), lock={"close_time_s": 0.05}) as b:
        b.plant.set_lock("a", True)
        b.drive(0.0, 0.1)
        assert b.plant.switches("a") == switches
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        assert not b.plant.lock_engaged("a")
        assert not b.plant.pull_test("a").holds


def test_pins_that_leave_while_the_cam_closes_are_not_caught(bench):
    with bench("bullet", BEFORE) as b:
        b.drive(0.05, 2.0, until_seated=True)
        b.plant.set_lock("a", True)
        b.drive(-0.1, 0.6)
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        assert not b.plant.lock_engaged("a")


def test_the_lock_takes_the_units_as_they_are(bench):
    """Closing moves nothing: the constraint is made from the measured pose, and contact no longer pushes."""
    with bench("bullet", ASKEW) as b:
        b.drive(0.05, 2.0, until_seated=True)
        b.drive(0.05, 0.5)
        b.plant.set_lock("a", True)
        b.drive(0.05, 0.45)
        before = b.X_DP()
        b.drive(0.05, 0.2)
        b.drive(0.0, 0.5)
        after = b.X_DP()
        assert b.plant.lock_engaged("a")
    assert abs(before.y) > 1e-3  # it does lean against its play
    assert (after.x, after.y) == pytest.approx((before.x, before.y), abs=5e-5)
    assert after.yaw == pytest.approx(before.yaw, abs=1e-3)


@pytest.mark.parametrize("kind", PLANTS)
def test_a_locked_unit_cannot_drive_off_and_an_unlocked_one_backs_out(bench, kind):
    with bench(kind, ASKEW) as b:
        b.dock()
        b.drive(-0.2, 0.8)
        assert abs(b.gap) < 3e-4
        assert b.plant.lock_engaged("a")
        b.drive(0.0, 0.8)
        b.plant.set_lock("a", False)
        assert b.plant.lock_position("a") is LockPosition.OPEN
        b.drive(0.0, 0.1)
        assert abs(b.gap) < 5e-4  # letting go throws nothing apart
        b.drive(-0.1, 1.0)
        assert b.gap > 0.07
        assert abs(b.X_DP().yaw) < math.radians(1.0)
        assert b.plant.switches("a") == (False, False)
        # The ports are solid again, and the lock works a second time.
        b.dock(v=0.08)
        assert abs(b.gap) < 5e-4
        assert b.plant.pull_test("a").holds


@pytest.mark.parametrize("kind", PLANTS)
def test_a_unit_may_dock_anew_as_soon_as_its_lock_is_open(bench, kind):
    """The parting pair is looked after, although another mechanism has taken the unit over."""
    with bench(kind, BEFORE) as b:
        b.dock()
        b.plant.set_lock("a", False)
        b.plant.begin_dock(b.scene.plan[0])
        b.drive(-0.1, 0.8)
        assert b.gap > 0.03
        b.dock()
        assert abs(b.gap) < 5e-4  # solid, so the faces stop it
        assert b.plant.lock_engaged("a")


def test_units_that_part_while_they_overlap_are_not_thrown(bench):
    """The contact of a pair comes back only when it has nothing to push apart."""
    with bench("bullet", BEFORE) as b:
        b.dock()
        world = b.plant.world
        X_WA = b.plant.pose("a")
        world.place("a", X_WA @ SE2(0.004, 0.0, 0.0), b.plant.wheel_angles("a"))  # 4 mm into the other
        b.plant.set_lock("a", False)
        for _ in range(24):
            b.plant.step()
            # Thrown means as fast as the overlap over a tick or two, 0.5 m/s and more.
            assert abs(b.plant.twist("a").v) < 0.05
        b.drive(-0.1, 0.8)
        assert b.gap > 0.02
        b.drive(0.1, 1.5)
        assert abs(b.gap) < 5e-4


@pytest.mark.parametrize("kind", PLANTS)
def test_a_plug_keeps_the_pins_from_their_seat_until_it_is_taken_out(bench, kind):
    with bench(kind, BEFORE) as b:
        b.plant.set_plug("b", "rear", True)
        b.plant.set_plug("b", "rear", True)  # once more does no harm
        b.drive(0.05, 1.5)
        assert b.gap > 0.008
        assert b.plant.switches("a") == (False, False)
        assert b.plant.pins_touch("a")
        b.plant.set_plug("b", "rear", False)
        b.plant.set_plug("b", "rear", False)
        b.drive(0.05, 1.0)
        assert b.plant.switches("a") == (True, True)


@pytest.mark.parametrize("kind", PLANTS)
def test_misuse_is_named(bench, kind):
    with bench(kind, BEFORE) as b:
        with pytest.raises(NoDockError, match="'b' has no docking target"):
            b.plant.set_lock("b", True)
        with pytest.raises(UnknownNameError, match="unknown unit 'c'"):
            b.plant.command("c", Twist())
        assert b.plant.switches("b") == (False, False)
        assert b.plant.lock_position("b") is LockPosition.OPEN
        b.dock()
        with pytest.raises(MsrrError, match="still locked"):
            b.plant.begin_dock(b.scene.plan[0])


def test_a_port_without_holes_cannot_be_docked_to(two_units, before_port):
    scene = two_units("front")
    with BulletWorld(scene, before_port(scene, BEFORE)) as world:
        plant = BulletPlant(world)
        with pytest.raises(GeometryError, match="port_front_hole_left"):
            plant.begin_dock(scene.plan[0])


def test_the_cam_takes_its_time_and_starts_anew():
    cam = LockActuator(0.5)
    assert not cam.step(1.0)
    cam.command(True)
    assert [cam.step(0.1) for _ in range(6)] == [False] * 4 + [True, False]
    cam.command(True)  # stays closed
    assert cam.position is LockPosition.CLOSED
    cam.command(False)
    cam.command(True)
    assert not cam.step(0.4)
    cam.command(False)
    cam.command(True)
    assert not cam.step(0.4)  # opened in between: the half way is lost
    assert cam.step(0.1)
