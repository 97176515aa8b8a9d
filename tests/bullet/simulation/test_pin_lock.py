"""The lock with contact: reach, tilt, play, and contact after unlocking."""

import math

import pytest

from msrr_bullet.simulation.bullet_plant import BulletPlant
from msrr_bullet.simulation.pin_depth import PinDepths
from msrr_bullet.simulation.world import BulletWorld
from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LockPosition
from msrr_scenes.random_streams import stream
from tests.bullet.conftest import before_port, bench, two_units

BEFORE = SE2(-0.025, 0.0, 0.0)
#: A start pose from which the seated unit leans against the play of the pins.
ASKEW = SE2(-0.025, 0.006, math.radians(-3.0))


@pytest.mark.parametrize(("gap_m", "holds"), [(0.0018, True), (0.0022, False)])
def test_the_lock_catches_pins_within_its_reach(gap_m, holds):
    """A seated pin ends half a millimetre before the bottom of its hole; the lock reaches 2.5 mm."""
    with bench("bullet", SE2(-gap_m, 0.0, 0.0), lock={"close_time_s": 0.05}) as b:
        b.plant.set_lock("a", True)
        b.drive(0.0, 0.1)
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        assert b.plant.lock_engaged("a") is holds


@pytest.mark.parametrize(("yaw_deg", "switches"), [(2.0, (False, True)), (-2.0, (True, False))])
def test_one_pin_in_reach_is_not_held(yaw_deg, switches):
    """The unit stands askew before its seat: one pin is deep enough for its switch, the other is not."""
    with bench("bullet", SE2(-0.0023, 0.0, math.radians(yaw_deg)), lock={"close_time_s": 0.05}) as b:
        b.plant.set_lock("a", True)
        b.drive(0.0, 0.1)
        assert b.plant.switches("a") == switches
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        assert not b.plant.lock_engaged("a")
        assert not b.plant.pull_test("a")


@pytest.mark.parametrize("port", ["rear", "left"])
def test_the_bound_on_their_distance_hides_no_pin_in_reach(port, monkeypatch):
    """400 poses in and about the seat; what tilts make of them is left to the margin of the bound."""
    rng = stream(0, "test_pin_lock/bound")
    with bench("bullet", SE2(-0.0018, 0.0, 0.0), port) as b:
        depths = PinDepths(b.plant.world, b.scene.plan[0], 0.0025)
        seat, found, near = b.plant.pose("a"), [], []
        for _ in range(400):
            off = SE2(*rng.normal(0.0, rng.choice([0.001, 0.03], 3), 3))
            b.plant.world.place("a", seat @ off, (0.0, 0.0))
            found.append(depths.left())
            near.append(depths._near())
            monkeypatch.setattr(depths, "_near", lambda: True)
            assert depths.left() == found[-1]
            monkeypatch.undo()
    assert any(math.isfinite(d) for left in found for d in left)
    assert not all(near)


def test_pins_that_leave_while_the_lock_closes_are_not_caught():
    with bench("bullet", BEFORE) as b:
        b.drive(0.05, 2.0, until_seated=True)
        b.plant.set_lock("a", True)
        b.drive(-0.1, 0.6)
        assert b.plant.lock_position("a") is LockPosition.CLOSED
        assert not b.plant.lock_engaged("a")


def test_the_lock_holds_the_units_at_their_present_pose():
    """Closing moves nothing: the constraint is built from the measured pose, and contact is disabled."""
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
    assert abs(before.y) > 1e-3  # the unit leans against the play of the pins
    assert (after.x, after.y) == pytest.approx((before.x, before.y), abs=5e-5)
    assert after.yaw == pytest.approx(before.yaw, abs=1e-3)


def test_units_that_part_while_they_overlap_are_not_thrown():
    """Contact is restored only when the units no longer overlap."""
    with bench("bullet", BEFORE) as b:
        b.dock()
        world = b.plant.world
        X_WA = b.plant.pose("a")
        world.place("a", X_WA @ SE2(0.004, 0.0, 0.0), b.plant.wheel_angles("a"))  # overlap of 4 mm
        b.plant.set_lock("a", False)
        for _ in range(24):
            b.plant.step()
            # A unit that is thrown moves by the overlap in a tick or two, at 0.5 m/s and more.
            assert abs(b.plant.twist("a").v) < 0.05
        b.drive(-0.1, 0.8)
        assert b.gap > 0.02
        b.drive(0.1, 1.5)
        assert abs(b.gap) < 5e-4


def test_the_pull_of_units_that_nothing_holds_ends_two_millimetres_apart():
    """A pull that went on would throw the units apart; the tick in which it ends adds a fraction of that."""
    with bench("bullet", BEFORE) as b:
        b.drive(0.05, 2.0, until_seated=True)
        before = b.gap
        assert not b.plant.pull_test("a")
        assert 0.002 <= b.gap - before < 0.004


def test_a_pulled_pair_does_not_roll_down_a_slope():
    """Free wheels would take it 2.4 m down the slope, by whatever else stands there."""
    floor = {"floor": {"slope_x_deg": 3.0, "slope_y_deg": -2.0}}
    with bench("bullet", BEFORE, lock={"pull_time_s": 10.0}, as_built=floor) as b:
        b.dock()
        b.drive(0.0, 0.5)
        before = b.plant.pose("b")
        assert b.plant.pull_test("a")
        after = b.plant.pose("b")
        assert math.dist((after.x, after.y), (before.x, before.y)) < 0.005
        for motor in b.plant._motors.values():
            motor.release()
        for _ in range(240):
            b.plant.world.step()
        assert b.plant.twist("b").v != pytest.approx(0.0, abs=0.1)  # the floor slopes again


def test_a_port_without_holes_cannot_be_docked_to():
    scene = two_units("front")
    with BulletWorld(scene, before_port(scene, BEFORE)) as world:
        plant = BulletPlant(world)
        with pytest.raises(GeometryError, match="port_front_hole_left"):
            plant.begin_dock(scene.plan[0])
