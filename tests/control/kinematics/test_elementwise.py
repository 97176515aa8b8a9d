"""One robot and a thousand trials: the same text, the same bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_control.kinematics import elementwise
from msrr_control.kinematics.controlled_point import offset_point, point_velocity, rotate, twist_for
from msrr_control.kinematics.elementwise import at_least, at_most, join, limit, number, split, where

TRIALS = 40


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "tanh", "exp", "log1p", "sqrt", "sinc", "tanh_tan"])
def test_a_function_of_a_number_is_that_of_an_array_to_the_bit(name: str) -> None:
    x = np.random.default_rng(0).uniform(0.0, 1.5, 4000)
    function = getattr(elementwise, name)
    assert [function(value) for value in x.tolist()] == function(x).tolist()
    assert type(function(0.5)) is float


@pytest.mark.parametrize("name", ["hypot", "atan2"])
def test_length_and_direction_of_numbers_are_those_of_arrays_to_the_bit(name: str) -> None:
    x, y = np.random.default_rng(1).uniform(-2.0, 2.0, (2, 4000))
    function = getattr(elementwise, name)
    assert [function(*pair) for pair in zip(x.tolist(), y.tolist(), strict=True)] == function(x, y).tolist()


def test_bounds() -> None:
    x = np.array([-2.0, -0.5, 0.0, 0.5, 2.0])
    for bound, args in ((limit, (-1.0, 1.0)), (at_least, (0.1,)), (at_most, (0.1,))):
        assert [bound(value, *args) for value in x.tolist()] == bound(x, *args).tolist()
        assert math.isnan(bound(math.nan, *args))
    assert where(True, 1.0, 2.0) == 1.0
    assert where(x > 0.0, 1.0, 2.0).tolist() == [2.0, 2.0, 2.0, 1.0, 1.0]


def test_taking_apart_and_putting_together() -> None:
    assert split(np.array([1.0, 2.0])) == [1.0, 2.0]
    many = np.arange(12.0).reshape(2, 3, 2)
    assert [part.shape for part in split(many)] == [(2, 3), (2, 3)]
    for vectors in (np.array([1.0, 2.0]), many):
        assert join(*split(vectors)).tolist() == vectors.tolist()
    assert type(number(np.array(3.0))) is float
    assert number(many) is many


def test_points_and_twists_of_one_robot_are_those_of_many() -> None:
    rng = np.random.default_rng(2)
    pose, twist, angle = rng.normal(size=(TRIALS, 3)), rng.normal(size=(TRIALS, 2)), rng.normal(size=TRIALS)
    for i in range(TRIALS):
        yaw = np.asarray(angle[i])
        assert (offset_point(pose[i], 0.1) == offset_point(pose, 0.1)[i]).all()
        assert (rotate(twist[i], yaw) == rotate(twist, angle)[i]).all()
        assert (point_velocity(twist[i], yaw, 0.1) == point_velocity(twist, angle, 0.1)[i]).all()
        assert (twist_for(twist[i], yaw, -0.1) == twist_for(twist, angle, -0.1)[i]).all()
