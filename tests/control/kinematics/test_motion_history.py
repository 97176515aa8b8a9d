"""The recent motion of a unit, and the motion that commands under way will make."""

import numpy as np
import pytest

from msrr_control.kinematics.elementwise import join, split
from msrr_control.kinematics.motion_history import MotionHistory, coast, under_way
from msrr_control.kinematics.unicycle import drive
from msrr_scenes.specs.vehicle import LimitsSpec

TIGHT = LimitsSpec.model_validate({"setting": "tight"})
DT = 0.02


def test_the_motion_since_an_exposure_is_that_of_the_drive() -> None:
    """300 units under random commands, seen up to 0.2 s late: the means of two readings are as good.

    The bound is that of the trapezoid rule: a drive bends by dw_max kappa, over 20 ms and ten intervals.
    """
    rng = np.random.default_rng(3)
    twist = np.zeros((300, 2))
    age = rng.uniform(0.0, 0.2, 300)
    history = MotionHistory.starting(split(twist))
    command = twist
    start, means = np.zeros(2), []
    for step in range(120):
        if step % 6 == 0:
            command = rng.uniform([-0.3, -1.0], [0.3, 1.0], (300, 2))
        twist, mean = drive(twist, command, TIGHT, DT)
        means.append(mean)
        history = history.advanced(split(twist), DT, age)
        whole = np.minimum((age / DT).astype(int), step + 1)
        expected = np.array([sum((means[-k - 1][i] for k in range(n)), start) for i, n in enumerate(whole)])
        rest = age - DT * whole
        last = [means[-n - 1][i] if n <= step else (0.0, 0.0) for i, n in enumerate(whole)]
        expected = DT * expected + rest[:, None] * np.array(last)
        bound = 10 * TIGHT.dw_max_radps2 * TIGHT.kappa_per_s * DT**3 / 12
        np.testing.assert_allclose(np.column_stack(history.since(age)), expected, atol=3 * bound)
    assert len(history.past) == 10


def test_before_the_first_instant_a_unit_moved_as_it_did_then() -> None:
    history = MotionHistory.starting((0.2, 0.5))
    age = np.array(0.1)
    assert history.since(age) == pytest.approx((0.02, 0.05))
    history = history.advanced((0.1, 0.5), DT, age)
    assert history.since(age) == pytest.approx((DT * 0.15 + 0.08 * 0.2, 0.05))


def test_an_estimate_of_now_needs_no_history() -> None:
    history = MotionHistory.starting((0.0, 0.0)).advanced((1.0, 1.0), DT, np.array(0.0))
    assert history.past == ()
    assert history.since(np.array(0.0)) == (0.0, 0.0)


@pytest.mark.parametrize("latency", [0.0, 0.02, 0.03, 0.06])
def test_coasting_is_what_the_drive_does_until_the_command_arrives(latency: float) -> None:
    """By a drive that is stepped at 1 ms and takes each command when it arrives."""
    rng = np.random.default_rng(4)
    start = rng.uniform([-0.3, -1.0], [0.3, 1.0], (50, 2))
    sent = [rng.uniform([-0.3, -1.0], [0.3, 1.0], (50, 2)) for _ in range(under_way(latency, DT))]
    twist, moved = start, np.zeros((50, 2))
    for ms in range(round(1e3 * latency)):
        # The command of k periods before now arrives at latency - k periods.
        force = min(k for k in range(1, len(sent) + 1) if 1e3 * (latency - k * DT) <= ms + 1e-9)
        twist, mean = drive(twist, sent[force - 1], TIGHT, 1e-3)
        moved = moved + 1e-3 * mean
    then, length, turn = coast(split(start), [split(command) for command in sent], latency, TIGHT, DT)
    np.testing.assert_allclose(join(*then), twist, atol=1e-12)
    np.testing.assert_allclose(np.broadcast_to(length, 50), moved[:, 0], atol=1e-12)
    np.testing.assert_allclose(np.broadcast_to(turn, 50), moved[:, 1], atol=1e-12)


def test_commands_under_way() -> None:
    """A command arrives within the period in which it is sent, at its end, or later; 0.14 / 0.02 > 7."""
    assert [under_way(latency, DT) for latency in (0.0, 0.01, 0.02, 0.03, 0.14)] == [0, 1, 1, 2, 7]
