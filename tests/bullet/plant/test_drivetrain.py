"""The drivetrain as it was built: rolling by true wheels, lag, dead zone and backlash."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from msrr_bullet.plant.drivetrain import Drivetrain
from msrr_bullet.plant.limited_drive import wheel_speeds
from msrr_bullet.plant.plant import Plant
from msrr_bullet.simulation.simulation import open_simulation
from msrr_scenes.as_built import BuiltDrive, draw_as_built
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Twist
from msrr_scenes.placement.placement import Placement

DT = 1.0 / 240.0
PLACEMENT = Placement({"a": SE2(-0.5, 0.3, 0.4), "b": SE2(1.0, -1.0, 0.0)}, {})


@pytest.fixture(scope="module")
def unit() -> UnitGeometry:
    return load_scene("close_range").geometry("a")


@contextmanager
def open_plant(plant: str, drive: str) -> Iterator[Plant]:
    changes = {"plant": plant, "perception": "parametric", "as_built": f"{{drive: {drive}}}"}
    scene = load_scene("close_range", changes)
    with open_simulation(scene, PLACEMENT, draw_as_built(scene, 0)) as simulation:
        yield simulation.plant


def test_a_drivetrain_as_designed_turns_the_wheels_as_the_drive_wants(unit: UnitGeometry) -> None:
    ideal, twist = Drivetrain(unit, BuiltDrive()), Twist(0.123, -0.456)
    assert ideal.step(twist, DT) == wheel_speeds(twist, unit) == ideal.rolling(twist)
    assert (ideal.play, ideal.at_rest) == ((0.0, 0.0), True)


def test_motion_and_rolling_are_inverse(unit: UnitGeometry) -> None:
    built = Drivetrain(unit, BuiltDrive(radius_scale=(1.05, 0.98), track_scale=1.02))
    motion = built.motion((3.0, -2.0))
    assert built.rolling(motion) == pytest.approx((3.0, -2.0))
    r, b = unit.wheel_radius, unit.track
    assert motion.v == pytest.approx(0.5 * r * (1.05 * 3.0 - 0.98 * 2.0))
    assert motion.w == pytest.approx(r * (-0.98 * 2.0 - 1.05 * 3.0) / (1.02 * b))


def test_a_lagging_motor_has_made_63_percent_of_a_step_after_its_time_constant(unit: UnitGeometry) -> None:
    lagging, wanted = Drivetrain(unit, BuiltDrive(lag_s=0.15)), Twist(0.1, 0.0)
    for _ in range(36):  # 0.15 s
        speeds = lagging.step(wanted, DT)
    full = wheel_speeds(wanted, unit)[0]
    assert speeds == pytest.approx((full * (1.0 - math.exp(-1.0)),) * 2)
    for _ in range(480):
        speeds = lagging.step(Twist(), DT)
    assert speeds == (0.0, 0.0)
    assert lagging.at_rest


@pytest.mark.parametrize("lag_s", [0.02, 0.1, 0.65, 3.0])
@pytest.mark.parametrize("v", [0.0005, -0.002, 0.01])
def test_a_lagging_motor_gets_to_any_speed(unit: UnitGeometry, lag_s: float, v: float) -> None:
    """It once stood for good where the first tick of a slow start was taken for the end of a stop."""
    drivetrain, twist = Drivetrain(unit, BuiltDrive(lag_s=lag_s)), Twist(v, 0.0)
    for _ in range(math.ceil(6.0 * lag_s / DT)):
        speeds = drivetrain.step(twist, DT)
    assert speeds == pytest.approx(wheel_speeds(twist, unit), rel=0.01)
    for _ in range(math.ceil(20.0 * lag_s / DT)):
        drivetrain.step(Twist(), DT)
    assert drivetrain.at_rest


def test_a_motor_does_not_turn_in_its_dead_zone(unit: UnitGeometry) -> None:
    stiff = Drivetrain(unit, BuiltDrive(dead_zone_radps=0.5))
    slow, fast = Twist(0.49 * unit.wheel_radius, 0.0), Twist(0.51 * unit.wheel_radius, 0.0)
    assert stiff.step(slow, DT) == (0.0, 0.0)
    assert stiff.step(fast, DT) == wheel_speeds(fast, unit)


def test_a_wheel_stands_until_its_motor_has_taken_up_the_play(unit: UnitGeometry) -> None:
    """Forward by half the play, then after each reversal by all of it; motor and wheel differ by the play."""
    play = math.radians(3.0)
    loose, motor, wheel = Drivetrain(unit, BuiltDrive(backlash_rad=play)), 0.0, 0.0
    for v, lost in ((0.1, 0.5 * play), (-0.1, play), (0.1, play)):
        before = motor - wheel
        for _ in range(120):
            speed, _ = loose.step(Twist(v, 0.0), DT)
            motor += wheel_speeds(Twist(v, 0.0), unit)[0] * DT
            wheel += speed * DT
            assert motor - wheel == pytest.approx(loose.play[0], abs=1e-9)
        assert abs(motor - wheel - before) == pytest.approx(lost)


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
def test_a_larger_wheel_turns_the_unit_and_its_encoder_does_not_show_it(plant: str) -> None:
    """5 % more on the left: v rises by 2.5 %, and the unit turns right by 0.05 r w / b."""
    with open_plant(plant, "{radius_left_percent: 5}") as moving:
        moving.command("a", Twist(0.2, 0.0))
        for _ in range(240):
            moving.step()
        X_0, angles_0 = moving.pose("a"), moving.motor_angles("a")
        for _ in range(240):
            moving.step()
        motion = (X_0.inverse() @ moving.pose("a")).log()
        left, right = (b - a for a, b in zip(angles_0, moving.motor_angles("a"), strict=True))
    drawn = load_scene("close_range").geometry("a")
    assert left == pytest.approx(0.2 / drawn.wheel_radius, rel=0.01)
    assert right == pytest.approx(left, rel=0.01)
    assert motion[0] == pytest.approx(0.205, rel=0.01)
    assert motion[2] == pytest.approx(-0.05 * 0.2 / drawn.track, rel=0.05)


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
def test_a_wider_track_turns_less(plant: str) -> None:
    with open_plant(plant, "{track_percent: 10}") as moving:
        moving.command("a", Twist(0.0, 1.0))
        for _ in range(240):
            moving.step()
        yaw_0 = moving.pose("a").yaw
        for _ in range(240):
            moving.step()
        assert moving.pose("a").yaw - yaw_0 == pytest.approx(1.0 / 1.1, rel=0.01)


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
def test_encoders_sit_on_the_motors_side_of_the_play(plant: str) -> None:
    with open_plant(plant, "{backlash_deg: 20}") as moving:
        moving.command("a", Twist(0.1, 0.0))
        for _ in range(120):
            moving.step()
        ahead = [m - w for m, w in zip(moving.motor_angles("a"), moving.wheel_angles("a"), strict=True)]
        assert ahead == pytest.approx([math.radians(10.0)] * 2)
        assert moving.pose("a").x > -0.5


def test_a_lagging_unit_is_not_put_to_sleep_before_it_stands() -> None:
    with open_plant("bullet", "{lag_ms: 400}") as moving:
        moving.command("a", Twist(0.3, 0.0))
        for _ in range(480):
            moving.step()
        moving.command("a", Twist())
        for _ in range(960):
            moving.step()
            if abs(moving.twist("a").v) > 0.01:
                assert not moving.is_asleep("a")
        assert abs(moving.twist("a").v) < 1e-3
