import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_control.kinematics.unicycle import advance_pose, drive
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.vehicle import LimitsSpec

LENGTHS, TURNS = st.floats(-2.0, 2.0), st.floats(-3.0, 3.0)
DT = 0.02
SETTINGS = ["normal", "tight"]


def limits_of(setting: str) -> LimitsSpec:
    return LimitsSpec.model_validate({"setting": setting})


def moved_by(pose: Array, twist: Array, dt: float) -> Array:
    return advance_pose(pose, dt * twist[..., 0], dt * twist[..., 1])


@given(LENGTHS, TURNS, TURNS)
def test_an_arc_is_the_exponential_of_its_twist(length: float, turn: float, yaw: float) -> None:
    start = SE2(0.3, -0.2, yaw)
    moved = advance_pose(start.as_array(), np.array(length), np.array(turn))
    expected = start @ SE2.exp(length, 0.0, turn)
    np.testing.assert_allclose(moved[:2], [expected.x, expected.y], atol=1e-9)
    assert np.cos(moved[2] - expected.yaw) == pytest.approx(1.0)


def test_many_poses_move_as_each_of_them() -> None:
    rng = np.random.default_rng(4)
    poses, lengths, turns = rng.normal(size=(3, 5, 3)), rng.normal(size=(3, 5)), rng.normal(size=(3, 5))
    together = advance_pose(poses, lengths, turns)
    for i, j in np.ndindex(3, 5):
        np.testing.assert_array_equal(together[i, j], advance_pose(poses[i, j], lengths[i, j], turns[i, j]))


@pytest.mark.parametrize("setting", SETTINGS)
def test_the_lag_behind_a_ramp_is_one_over_kappa(setting: str) -> None:
    """What is driven in a step lags the command held in it; speed and turn rate, both below their limits."""
    limits = limits_of(setting)
    slope = 0.5 * np.array([limits.a_max_mps2, limits.dw_max_radps2])
    twist, pose, lag = np.zeros(2), np.zeros(3), np.zeros(2)
    most = np.array([limits.v_max_mps, limits.w_max_radps])
    steps = int(0.95 * np.min(most / slope) / DT)
    for k in range(steps):
        command = slope * k * DT
        twist, mean = drive(twist, command, limits, DT)
        moved = moved_by(pose, mean, DT)
        chord = np.hypot(*(moved - pose)[:2]) / np.sinc(0.5 * (moved - pose)[2] / np.pi)
        lag = (command - [chord / DT, (moved - pose)[2] / DT]) / slope
        pose = moved
    # What is left of the transient is exp(-kappa t) of the lag, a 38th part or less.
    assert np.exp(-limits.kappa_per_s * steps * DT) < 0.03
    np.testing.assert_allclose(lag, 1.0 / limits.kappa_per_s, rtol=0.03)


@pytest.mark.parametrize("setting", SETTINGS)
def test_the_closed_form_solves_eq_3(setting: str) -> None:
    """500 random steps of up to 0.3 s against Euler's rule in steps of a thousandth of that."""
    limits, rng = limits_of(setting), np.random.default_rng(3)
    most, rate = (
        np.array(v)
        for v in zip(
            (limits.v_max_mps, limits.a_max_mps2), (limits.w_max_radps, limits.dw_max_radps2), strict=True
        )
    )
    for dt in (0.004, DT, 0.3):
        start, command = rng.uniform(-2.0, 2.0, (2, 500, 2)) * most
        after, mean = drive(start, command, limits, dt)
        speed, covered = start.copy(), np.zeros_like(start)
        h = dt / 1000
        for _ in range(1000):
            change = np.clip(limits.kappa_per_s * (np.clip(command, -most, most) - speed), -rate, rate)
            covered += h * (speed + 0.5 * h * change)
            speed += h * change
        np.testing.assert_allclose(after, speed, atol=2e-3 * dt * rate.max())
        np.testing.assert_allclose(mean, covered / dt, atol=2e-3 * dt * rate.max())


@pytest.mark.parametrize("setting", SETTINGS)
def test_two_half_steps_are_one_whole(setting: str) -> None:
    limits, rng = limits_of(setting), np.random.default_rng(4)
    start, command = rng.uniform(-1.5, 1.5, (2, 300, 2))
    whole, mean = drive(start, command, limits, DT)
    half, first = drive(start, command, limits, 0.5 * DT)
    end, second = drive(half, command, limits, 0.5 * DT)
    np.testing.assert_allclose(end, whole, atol=1e-14)
    np.testing.assert_allclose(0.5 * (first + second), mean, atol=1e-13)


def test_a_step_rolls_to_two_micrometres() -> None:
    """At the limits of the shipped unit, against 200 parts of the same step."""
    limits, rng = limits_of("normal"), np.random.default_rng(5)
    most = np.array([limits.v_max_mps, limits.w_max_radps])
    start, command = rng.uniform(-1.0, 1.0, (2, 400, 2)) * most
    _, mean = drive(start, command, limits, DT)
    coarse = moved_by(np.zeros((400, 3)), mean, DT)
    fine, twist = np.zeros((400, 3)), start
    for _ in range(200):
        twist, part = drive(twist, command, limits, DT / 200)
        fine = moved_by(fine, part, DT / 200)
    assert np.abs(coarse - fine).max() < 2e-6
