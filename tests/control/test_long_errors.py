"""The error dynamics that the long-distance law was derived for, and single steps worked out by hand."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.feedback.auxiliary import AuxiliaryGains
from msrr_control.path_following.path import Desired
from msrr_control.path_following.reference import (
    ReferenceGains,
    ReferenceState,
    SideWall,
    reference_step,
)
from msrr_control.path_following.tracking import (
    Obstacles,
    SpringGains,
    TrackingGains,
    TrackingState,
    tracking_step,
)
from msrr_scenes.specs.vehicle import LimitsSpec

LIMITS = LimitsSpec()
NOWHERE = SideWall(np.array(False), np.zeros(2), np.array(0.0))
ALONE = Obstacles(np.zeros((0, 2)), np.zeros(0, dtype=bool))
TINY = 1e-6  # [s]: a derivative to six digits
NEAR = st.floats(-0.5, 0.5)
PAIR = st.tuples(NEAR, NEAR).map(np.array)
#: Off the clamp at 1.5, where the auxiliary state no longer moves as its equation says.
LAMBDA = st.tuples(st.floats(-1.3, 1.3), st.floats(-1.3, 1.3)).map(np.array)


def _guidance_errors(state: ReferenceState, desired: Desired, gains: ReferenceGains) -> np.ndarray:
    """z1 and z2 of eqs. 11 and 12, as rows."""
    point, rate, _ = desired
    z1 = state.position - point
    z2 = state.velocity - (rate - gains.c1_per_s * z1) - gains.windup.gamma_m * np.tanh(state.lam)
    return np.stack([z1, z2])


@settings(max_examples=200, deadline=None)
@given(PAIR, PAIR, LAMBDA, PAIR, PAIR, PAIR)
def test_the_errors_of_the_reference_fall_as_they_were_designed_to(
    position: np.ndarray,
    velocity: np.ndarray,
    lam: np.ndarray,
    point: np.ndarray,
    rate: np.ndarray,
    forward: np.ndarray,
) -> None:
    """z1' = z2 - c1 z1 + gamma tanh(lambda) and z2' = -c2 z2 - z1, saturated or not.

    It is what u_r is for: every term of it is needed, with its sign, and lambda takes up what saturation
    takes away.
    """
    gains = ReferenceGains()
    before = ReferenceState(position, velocity, lam)
    now = Desired(point, rate, forward)
    then = Desired(point + TINY * rate, rate + TINY * forward, forward)
    after = reference_step(before, now, NOWHERE, gains, TINY)
    z1, z2 = _guidance_errors(before, now, gains)
    falls = (_guidance_errors(after, then, gains) - np.stack([z1, z2])) / TINY
    np.testing.assert_allclose(
        falls[0], z2 - gains.c1_per_s * z1 + gains.windup.gamma_m * np.tanh(lam), atol=1e-4
    )
    np.testing.assert_allclose(falls[1], -gains.c2_per_s * z2 - z1, atol=5e-4)


def test_one_step_of_the_reference_by_hand() -> None:
    """With c1 = 0.5, c2 = 2, k = 0.2, gamma = 0.1 and tanh(lambda) = 0.6, lambda = 0.693147.

    x: z1 = 0.1; z2 = 0.2 - (0.1 - 0.5 x 0.1) - 0.1 x 0.6 = 0.09;
    u_r = -0.18 + 0.05 - 0.2 x 0.693147 - 0.1 - 0.5 (0.09 - 0.05 + 0.06) = -0.418629.
    y: all zero but p_d' = 0.1: z2 = -0.1, u_r = 0.2 - 0.5 (-0.1) = 0.25.
    """
    gains = ReferenceGains(c1_per_s=0.5, c2_per_s=2.0, windup=AuxiliaryGains(k_mps=0.2, gamma_m=0.1))
    state = ReferenceState(np.array([0.3, 0.0]), np.array([0.2, 0.0]), np.array([math.log(2.0), 0.0]))
    desired = Desired(np.array([0.2, 0.0]), np.array([0.1, 0.1]), np.array([0.05, 0.0]))
    after = reference_step(state, desired, NOWHERE, gains, 0.1)
    acceleration = (after.velocity - state.velocity) / 0.1
    np.testing.assert_allclose(acceleration, [-0.418629, 0.25], atol=1e-6)
    np.testing.assert_allclose(after.position, [0.3 + 0.02 - 0.5e-2 * 0.418629, 0.5e-2 * 0.25], atol=1e-8)


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

    def error(tip: np.ndarray, at: np.ndarray, lam: np.ndarray) -> np.ndarray:
        return tip - at - gains.windup.gamma_m * np.tanh(lam)

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
    spring = SpringGains(windup=AuxiliaryGains(k_mps=1e-9, gamma_m=0.02))  # it decays not at all in a step
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
