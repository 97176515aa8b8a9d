"""The error dynamics that the long-distance law was derived for, and single steps worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.feedback.auxiliary import AuxiliaryGains
from msrr_control.path_following.obstacle_forces import Obstacles, SpringGains
from msrr_control.path_following.reference import ReferenceState, reference_start
from msrr_control.path_following.tracking import TrackingGains, TrackingState, tracking_start, tracking_step
from msrr_scenes.specs.vehicle import LimitsSpec

LIMITS = LimitsSpec()
ALONE = Obstacles(np.zeros((0, 2)), np.zeros(0, dtype=bool))
TINY = 1e-6  # [s]: a derivative to six digits
NEAR = st.floats(-0.5, 0.5)
PAIR = st.tuples(NEAR, NEAR).map(np.array)
#: Off the clamp at 1.5, where the auxiliary state no longer moves as its equation says.
LAMBDA = st.tuples(st.floats(-1.3, 1.3), st.floats(-1.3, 1.3)).map(np.array)


def _tip(pose: np.ndarray, offset: float) -> np.ndarray:
    return pose[:2] + offset * np.array([math.cos(pose[2]), math.sin(pose[2])])


def _tip_velocity(twist: np.ndarray, yaw: float, offset: float) -> np.ndarray:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([c * twist[0] - s * offset * twist[1], s * twist[0] + c * offset * twist[1]])


@settings(max_examples=200, deadline=None)
@given(PAIR, st.floats(-3.0, 3.0), LAMBDA, LAMBDA, PAIR, PAIR, st.floats(-0.3, 0.3), st.floats(-1.0, 1.0))
def test_the_tracking_error_falls_as_it_was_designed_to(
    place: np.ndarray,
    yaw: float,
    lam: np.ndarray,
    lam_s: np.ndarray,
    goal: np.ndarray,
    pace: np.ndarray,
    v: float,
    w: float,
) -> None:
    """e' = -k_l e - gamma_s tanh(lambda_s) for a drive that does what the limiter lets through.

    Whatever the limits take off: lambda takes it up, and its decay k lambda has to be asked of the drive.
    """
    gains, offset = TrackingGains(), 0.1
    pose = np.array([*place, yaw])
    state = TrackingState(lam, lam_s, np.array([v, w]))
    reference = ReferenceState(goal, pace, np.zeros(2))
    _, after = tracking_step(state, reference, pose, ALONE, gains, LIMITS, offset, TINY)

    def error(tip: np.ndarray, goal: np.ndarray, lam: np.ndarray) -> np.ndarray:
        return tip - goal - gains.windup.gamma_m * np.tanh(lam)

    tip = _tip(pose, offset)
    before = error(tip, goal, lam)
    moved = tip + TINY * _tip_velocity(after.limited, yaw, offset)
    falls = (error(moved, goal + TINY * pace, after.lam) - before) / TINY
    push = gains.spring.windup.gamma_m * np.tanh(after.lam_s)
    np.testing.assert_allclose(falls, -gains.k_l_per_s * before - push, atol=1e-3)


def test_one_command_by_hand() -> None:
    """With k_l = 1, k = 0.05, gamma = 0.1, gamma_s = 0.02, tanh(lambda) = 0.6 and tanh(lambda_s) = -0.6.

    Along x: e = 0.02 - 0.1 x 0.6 = -0.04, u = 0.04 + 0.1 - 0.05 x 0.693147 + 0.02 x 0.6 = 0.1173426.
    Along y: lambda = 0, e = -0.01, u = 0.01 + 0.03 = 0.04. The unit looks along x: v = u_x and w = u_y / l.
    Then turned by a quarter to the left with its tip at the same place: v = u_y and w = -u_x / l.
    """
    still = AuxiliaryGains.model_construct(k_mps=1e-9, gamma_m=0.02, clamp=1.5)  # without a decay in a step
    spring = SpringGains.model_construct(**{**dict(SpringGains()), "windup": still})
    gains = TrackingGains(k_l_per_s=1.0, windup=AuxiliaryGains(k_mps=0.05, gamma_m=0.1), spring=spring)
    lam, offset = math.log(2.0), 0.2
    state = TrackingState(np.array([lam, 0.0]), np.array([-lam, 0.0]), np.zeros(2))
    reference = ReferenceState(np.array([0.18, 0.01]), np.array([0.1, 0.03]), np.zeros(2))
    for pose, expected in (
        ([0.0, 0.0, 0.0], [0.1173426, 0.04 / offset]),
        ([0.2, -0.2, 0.5 * math.pi], [0.04, -0.1173426 / offset]),
    ):
        command, _ = tracking_step(state, reference, np.array(pose), ALONE, gains, LIMITS, offset, 0.02)
        np.testing.assert_allclose(command, expected, atol=1e-6)


DT = 0.02
NORMAL = LimitsSpec.model_validate({})
TIGHT = LimitsSpec.model_validate({"setting": "tight"})
POINT = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)).map(np.array)


@settings(max_examples=100, deadline=None)
@given(
    POINT,
    st.tuples(POINT, st.floats(-10.0, 10.0)),
    POINT,
    POINT,
    st.sampled_from([NORMAL, TIGHT]),
    st.booleans(),
)
def test_commands_stay_within_the_drive(goal, pose, velocity, obstacle, limits, on: bool) -> None:
    """Any reference, any pose, an obstacle anywhere, the unit's own place included."""
    state = tracking_start(np.array([9.0, -9.0]), limits)
    reference = reference_start(goal, velocity)
    rates = DT * np.array([limits.a_max_mps2, limits.dw_max_radps2])
    for _ in range(5):
        before = state.limited
        command, state = tracking_step(
            state,
            reference,
            np.array([*pose[0], pose[1]]),
            Obstacles(np.stack([obstacle, pose[0]]), np.array([True, True])),
            TrackingGains(),
            limits,
            0.1,
            DT,
            anti_windup=on,
            spring=on,
        )
        assert np.isfinite(command).all()
        assert abs(command[0]) <= limits.v_max_mps
        assert abs(command[1]) <= limits.w_max_radps
        assert np.abs(state.lam).max() <= 1.5
        towards = np.clip(command - before, -rates, rates)
        np.testing.assert_allclose(state.limited, before + towards, atol=1e-12)


def test_a_loop_slower_than_its_anti_windup_is_refused() -> None:
    with pytest.raises(ValueError, match="limit cycle"):
        TrackingGains(k_l_per_s=0.5)


@pytest.mark.parametrize("k_l", [0.05, 0.25])
def test_a_gain_that_leaves_nothing_of_the_decay_of_eq_20_is_refused(k_l: float) -> None:
    slow = AuxiliaryGains(k_mps=0.001, gamma_m=0.1)
    with pytest.raises(ValueError, match=r"k_l_per_s = 0.* more than 0.25 1/s: eq. 20"):
        TrackingGains(k_l_per_s=k_l, windup=slow)
    assert TrackingGains(k_l_per_s=0.26, windup=slow).k_l_per_s == 0.26
