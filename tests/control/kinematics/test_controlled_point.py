import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.kinematics.controlled_point import (
    offset_point,
    point_velocity,
    position_error,
    rotate,
    twist_for,
)

ANGLES = st.floats(-10.0, 10.0)
SPEEDS = st.floats(-5.0, 5.0)
OFFSETS = st.floats(0.01, 1.0) | st.floats(-1.0, -0.01)


@settings(max_examples=100, deadline=None)
@given(SPEEDS, SPEEDS, ANGLES, OFFSETS)
def test_the_mapping_and_its_inverse_undo_each_other(v: float, w: float, yaw: float, offset: float) -> None:
    twist = np.array([v, w])
    heading = np.array(yaw)
    velocity = point_velocity(twist, heading, offset)
    np.testing.assert_allclose(twist_for(velocity, heading, offset), twist, atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(SPEEDS, SPEEDS, ANGLES, OFFSETS)
def test_the_velocity_is_the_derivative_of_the_point(v: float, w: float, yaw: float, offset: float) -> None:
    h = 1e-6
    pose = np.array([0.3, -0.2, yaw])
    rate = np.array([v * np.cos(yaw), v * np.sin(yaw), w])
    numeric = (offset_point(pose + h * rate, offset) - offset_point(pose - h * rate, offset)) / (2 * h)
    np.testing.assert_allclose(point_velocity(np.array([v, w]), pose[2], offset), numeric, atol=1e-6)


def test_rotate_turns_counter_clockwise_and_broadcasts() -> None:
    quarter = np.array(np.pi / 2)
    np.testing.assert_allclose(rotate(np.array([1.0, 0.0]), quarter), [0.0, 1.0], atol=1e-15)
    turned = rotate(np.array([1.0, 0.0]), np.array([0.0, np.pi]))
    assert turned == pytest.approx(np.array([[1.0, 0.0], [-1.0, 0.0]]), abs=1e-15)


def test_a_position_error_is_cut_beyond_the_size_of_any_arena() -> None:
    np.testing.assert_allclose(position_error(np.array([1.0, 1e9, -1e9]), np.zeros(3)), [1.0, 100.0, -100.0])
    assert position_error(2.5, 1.0) == 1.5
