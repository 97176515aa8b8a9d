"""One robot and a thousand trials: the same text, the same bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_control.docking.controller import CONTROLLERS, LawController
from msrr_control.docking.law import DockSetup, Sensed
from msrr_control.kinematics import elementwise
from msrr_control.kinematics.elementwise import at_least, at_most, join, limit, number, split, where
from msrr_control.kinematics.offset_point import offset_point, point_velocity, rotate, twist_for
from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams
from msrr_control.path_following.path import Path
from msrr_control.path_following.reference import SideWall
from msrr_control.path_following.tracking import Obstacles
from msrr_scenes.specs.vehicle import LimitsSpec

TRIALS = 40
DT = 0.02


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "tanh", "exp", "log1p", "sqrt"])
def test_a_function_of_a_number_is_that_of_an_array_to_the_bit(name: str) -> None:
    x = np.random.default_rng(0).uniform(0.0, 1.5, 4000)
    function = getattr(elementwise, name)
    assert [function(value) for value in x.tolist()] == function(x).tolist()
    assert type(function(0.5)) is float


def test_lengths_and_powers_too() -> None:
    x, y = np.random.default_rng(1).uniform(0.0, 2.0, (2, 4000))
    assert [
        elementwise.hypot(*pair) for pair in zip(x.tolist(), y.tolist(), strict=True)
    ] == elementwise.hypot(x, y).tolist()
    assert [elementwise.power(value, 0.3) for value in x.tolist()] == elementwise.power(x, 0.3).tolist()


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


@pytest.mark.parametrize("walled", [False, True])
def test_the_long_distance_law_drives_one_robot_as_it_drives_many(walled: bool) -> None:
    """40 random courses past two obstacles, one absent, with or without a wall: 60 steps, every bit."""
    rng = np.random.default_rng(3)
    starts = np.column_stack([rng.normal(0.0, 0.1, (TRIALS, 2)), rng.uniform(-3.0, 3.0, TRIALS)])
    curvature = np.column_stack([rng.uniform(-1.0, 1.0, TRIALS), np.zeros(TRIALS)])
    lengths = np.column_stack([rng.uniform(0.3, 1.5, TRIALS), np.full(TRIALS, 0.2)])
    pose = starts + rng.normal(0.0, 0.03, (TRIALS, 3))
    centre, present = rng.normal(0.0, 0.6, (TRIALS, 2, 2)), np.tile([True, False], (TRIALS, 1))
    wall = SideWall(
        np.full(TRIALS, walled), rng.normal(0.0, 0.3, (TRIALS, 2)), rng.uniform(-3.0, 3.0, TRIALS)
    )
    law = C1PathFollowingLaw(C1PathFollowingParams(), LimitsSpec.model_validate({}), 0.1)
    twist = np.zeros((TRIALS, 2))
    many = law.start(pose, twist)
    ones = [law.start(pose[i], twist[i]) for i in range(TRIALS)]
    for _ in range(60):
        commands, many = law.step(
            many, Path(starts, curvature, lengths), pose, wall, Obstacles(centre, present), DT
        )
        for i in range(TRIALS):
            alone = SideWall(*(np.asarray(part[i]) for part in wall))
            path = Path(starts[i], curvature[i], lengths[i])
            command, ones[i] = law.step(ones[i], path, pose[i], alone, Obstacles(centre[i], present[i]), DT)
            assert (command == commands[i]).all()
        heading = np.column_stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])])
        pose = pose + DT * np.column_stack([heading * commands[:, :1], commands[:, 1]])
    assert np.abs(commands).max() > 0.1


@pytest.mark.parametrize("name", sorted(CONTROLLERS))
def test_a_docking_law_drives_one_robot_as_it_drives_many(name: str, facts: DockSetup) -> None:
    """40 random approaches, seen, predicted and lost: 60 steps, every bit."""
    rng = np.random.default_rng(4)
    controller = CONTROLLERS[name](facts)
    assert isinstance(controller, LawController)
    law = controller.law
    pose = np.column_stack(
        [rng.uniform(-0.8, -0.15, TRIALS), rng.normal(0.0, 0.05, TRIALS), rng.normal(0.0, 0.2, TRIALS)]
    )

    def sensed(rows: slice | int) -> Sensed:
        return Sensed(pose[rows], edges[rows], np.asarray(visibility[rows]), np.zeros((TRIALS, 2))[rows])

    edges = rng.normal(0.0, 0.3, (TRIALS, 2))
    visibility = rng.choice([0.0, 0.5, 1.0], TRIALS)
    many = law.start(sensed(slice(None)))
    ones = [law.start(sensed(i)) for i in range(TRIALS)]
    for _ in range(60):
        edges, visibility = rng.normal(0.0, 0.3, (TRIALS, 2)), rng.choice([0.0, 0.5, 1.0], TRIALS)
        commands, many = law.step(many, sensed(slice(None)), DT)
        for i in range(TRIALS):
            command, ones[i] = law.step(ones[i], sensed(i), DT)
            assert (command == commands[i]).all()
        heading = np.column_stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])])
        pose = pose + DT * np.column_stack([heading * commands[:, :1], commands[:, 1]])
    assert np.abs(commands).max() > 0.01
