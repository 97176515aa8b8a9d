import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_control.kinematics.unicycle import advance_pose
from msrr_scenes.geometry.se2 import SE2

LENGTHS, TURNS = st.floats(-2.0, 2.0), st.floats(-3.0, 3.0)


@given(LENGTHS, TURNS, TURNS)
def test_an_arc_is_the_exponential_of_its_twist(length: float, turn: float, yaw: float) -> None:
    start = SE2(0.3, -0.2, yaw)
    moved = advance_pose(start.as_array(), np.array(length), np.array(turn))
    expected = start @ SE2.exp(length, 0.0, turn)
    np.testing.assert_allclose(moved[:2], [expected.x, expected.y], atol=1e-9)
    assert np.cos(moved[2] - expected.yaw) == pytest.approx(1.0)


@given(LENGTHS, TURNS)
def test_the_way_back_ends_at_the_start(length: float, turn: float) -> None:
    start = np.array([0.3, -0.2, 0.7])
    end = advance_pose(start, np.array(length), np.array(turn))
    np.testing.assert_allclose(advance_pose(end, np.array(-length), np.array(-turn)), start, atol=1e-12)


def test_many_poses_move_as_each_of_them() -> None:
    rng = np.random.default_rng(4)
    poses, lengths, turns = rng.normal(size=(3, 5, 3)), rng.normal(size=(3, 5)), rng.normal(size=(3, 5))
    together = advance_pose(poses, lengths, turns)
    for i, j in np.ndindex(3, 5):
        np.testing.assert_array_equal(together[i, j], advance_pose(poses[i, j], lengths[i, j], turns[i, j]))
