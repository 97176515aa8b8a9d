"""The long-distance law steps many robots as it steps one, which it does fast enough."""

import numpy as np

from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams
from msrr_control.path_following.obstacle_forces import Obstacles
from msrr_control.path_following.path import Path
from msrr_control.path_following.reference import SideWall
from msrr_scenes.specs.vehicle import LimitsSpec

DT = 0.02
NORMAL = LimitsSpec.model_validate({})


def test_one_robot_steps_fast_enough(cost_s) -> None:
    law = C1PathFollowingLaw(C1PathFollowingParams(), NORMAL, 0.1)
    path = Path(np.zeros(3), np.array([0.8, 0.0]), np.array([2.0, 0.3]))
    pose = np.array([0.0, 0.01, 0.1])
    wall = SideWall(np.array(True), np.array([0.5, 0.2]), np.array(1.5))
    obstacles = Obstacles(np.array([[0.5, 0.0]]), np.array([True]))
    state = law.start(pose, np.zeros(2))

    def step() -> None:
        nonlocal state
        _, state = law.step(state, path, pose, wall, obstacles, DT)

    assert cost_s(step) < 2e-4


TRIALS = 40


def test_the_long_distance_law_drives_one_robot_as_it_drives_many() -> None:
    """40 random courses past two obstacles, one absent, half of them along a wall: 60 steps, every bit."""
    rng = np.random.default_rng(3)
    starts = np.column_stack([rng.normal(0.0, 0.1, (TRIALS, 2)), rng.uniform(-3.0, 3.0, TRIALS)])
    curvature = np.column_stack([rng.uniform(-1.0, 1.0, TRIALS), np.zeros(TRIALS)])
    lengths = np.column_stack([rng.uniform(0.3, 1.5, TRIALS), np.full(TRIALS, 0.2)])
    pose = starts + rng.normal(0.0, 0.03, (TRIALS, 3))
    centre, present = rng.normal(0.0, 0.6, (TRIALS, 2, 2)), np.tile([True, False], (TRIALS, 1))
    wall = SideWall(
        np.arange(TRIALS) % 2 == 0, rng.normal(0.0, 0.3, (TRIALS, 2)), rng.uniform(-3.0, 3.0, TRIALS)
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
