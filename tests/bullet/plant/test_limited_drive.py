import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_bullet.plant.limited_drive import LimitedDrive, wheel_speeds
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.messages import Twist
from msrr_scenes.specs.vehicle import LimitsSpec

NORMAL = LimitsSpec.model_validate({})


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-9, 9)), min_size=1, max_size=40))
@settings(max_examples=60, deadline=None)
def test_no_command_makes_a_drive_faster_or_quicker_than_its_limits(commands):
    dt = 1.0 / 240.0
    drive = LimitedDrive(NORMAL, dt)
    for v, w in commands:
        before = drive.velocity
        after = drive.step(Twist(v, w))
        assert abs(after.v) <= NORMAL.v_max_mps + 1e-12
        assert abs(after.w) <= NORMAL.w_max_radps + 1e-12
        assert abs(after.v - before.v) <= NORMAL.a_max_mps2 * dt + 1e-12
        assert abs(after.w - before.w) <= NORMAL.dw_max_radps2 * dt + 1e-12


def test_wheel_speeds_invert_to_the_twist():
    unit = read_unit(find_urdf("unit.urdf"))
    left, right = wheel_speeds(Twist(0.21, -0.6), unit)
    assert unit.wheel_radius * (left + right) / 2 == pytest.approx(0.21)
    assert unit.wheel_radius * (right - left) / unit.track == pytest.approx(-0.6)
