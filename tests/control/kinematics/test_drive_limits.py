import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_control.kinematics.drive_limits import limit_twist, nested_limit, nested_limit_twist, nested_limiter
from msrr_scenes.specs.vehicle import LimitsSpec

LIMITS = LimitsSpec.model_validate({})
SPEEDS = st.floats(-3.0, 3.0)


@given(SPEEDS, SPEEDS, st.floats(0.1, 100.0), st.floats(1e-3, 0.5))
def test_the_speed_changes_no_faster_than_allowed_and_never_overshoots(
    speed: float, command: float, kappa: float, dt: float
) -> None:
    after = nested_limit(speed, command, 0.4, 0.8, kappa, dt)
    wanted = min(max(command, -0.4), 0.4)
    assert abs(after - speed) <= 0.8 * dt * (1.0 + 1e-12)
    assert min(speed, wanted) - 1e-12 <= after <= max(speed, wanted) + 1e-12


@given(SPEEDS, SPEEDS)
def test_a_number_an_array_and_a_prepared_limiter_give_the_same_bits(speed: float, command: float) -> None:
    alone = nested_limit(speed, command, 0.4, 0.8, 10.0, 0.02)
    assert nested_limiter(0.4, 0.8, 10.0, 0.02)(speed, command) == alone
    assert nested_limit(np.array([speed]), np.array([command]), 0.4, 0.8, 10.0, 0.02)[0] == alone


def test_far_from_the_command_the_rate_limits_and_near_it_the_bandwidth() -> None:
    assert nested_limit(0.0, 0.4, 0.4, 0.8, 10.0, 0.02) == pytest.approx(0.8 * 0.02)
    assert nested_limit(0.39, 0.4, 0.4, 0.8, 10.0, 0.02) == pytest.approx(0.39 + 10.0 * 0.02 * 0.01)


def test_what_is_no_number_stays_none() -> None:
    assert math.isnan(nested_limit(0.0, math.nan, 0.4, 0.8, 10.0, 0.02))
    assert math.isnan(nested_limiter(0.4, 0.8, 10.0, 0.02)(0.0, math.nan))


def test_a_twist_is_limited_in_both_of_its_speeds() -> None:
    command = np.array([[9.0, -9.0], [0.0, 0.1]])
    after = nested_limit_twist(np.zeros((2, 2)), command, LIMITS, 1.0 / 0.02, 0.02)
    np.testing.assert_allclose(after[0], [0.02 * LIMITS.a_max_mps2, -0.02 * LIMITS.dw_max_radps2])
    fast = np.array([[LIMITS.v_max_mps, 0.0]])
    slowed = nested_limit_twist(fast, fast, LIMITS, 1.0, 10.0, LIMITS.v_close_mps)
    assert slowed[0, 0] == pytest.approx(LIMITS.v_close_mps)
    np.testing.assert_array_equal(limit_twist(command, 0.5, 1.0), [[0.5, -1.0], [0.0, 0.1]])
