"""The velocity of a unit by its encoders, against the arcs that its wheels have rolled."""

import pytest

from msrr_bullet.robot.wheel_speed import WheelSpeed
from msrr_scenes.messages import Twist, WheelOdometry

RADIUS, TRACK, PERIOD_NS = 0.033, 0.15, 10_000_000


def test_before_two_readings_a_unit_stands() -> None:
    speed = WheelSpeed(RADIUS, TRACK)
    assert speed.twist == Twist()
    speed.add(WheelOdometry("a", PERIOD_NS, 3.0, 4.0))
    assert speed.twist == Twist()


@pytest.mark.parametrize("twist", [Twist(0.2, 0.0), Twist(-0.1, 0.5), Twist(0.0, -1.0)], ids=str)
def test_the_velocity_is_that_between_the_last_two_readings(twist: Twist) -> None:
    speed, left, right = WheelSpeed(RADIUS, TRACK), 3.0, -2.0
    for k, share in enumerate((0.0, 5.0, 1.0)):  # it was faster before
        left += share * (twist.v - 0.5 * TRACK * twist.w) / RADIUS * 1e-9 * PERIOD_NS
        right += share * (twist.v + 0.5 * TRACK * twist.w) / RADIUS * 1e-9 * PERIOD_NS
        speed.add(WheelOdometry("a", k * PERIOD_NS, left, right))
    assert (speed.twist.v, speed.twist.w) == pytest.approx((twist.v, twist.w))


def test_a_reading_that_comes_twice_has_no_effect() -> None:
    speed = WheelSpeed(RADIUS, TRACK)
    for k in (0, 1, 1):
        speed.add(WheelOdometry("a", k * PERIOD_NS, 0.01 * k, 0.01 * k))
    assert speed.twist == Twist(pytest.approx(RADIUS), 0.0)
