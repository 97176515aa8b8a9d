"""A batch of trials is that many trials: what one of them meets is nothing to the others."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.feedback.auxiliary import AuxiliaryGains
from msrr_control.path_following.path import DesiredPoint
from msrr_control.path_following.reference import (
    ReferenceGains,
    ReferenceState,
    SideWall,
    reference_start,
    reference_step,
)


def test_a_wall_before_one_trial_is_nothing_to_the_others() -> None:
    """50 trials in one call and one by one; limits bite in most of them."""
    rng = np.random.default_rng(3)
    n = 50
    angle = rng.uniform(-np.pi, np.pi, n)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    foot = rng.normal(size=(n, 2))
    state = ReferenceState(
        foot + rng.uniform(0.05, 0.5, (n, 1)) * normal,
        0.2 * rng.normal(size=(n, 2)),
        0.1 * rng.normal(size=(n, 2)),
    )
    desired = DesiredPoint(
        state.position + 0.3 * rng.normal(size=(n, 2)), 0.2 * rng.normal(size=(n, 2)), rng.normal(size=(n, 2))
    )
    active = rng.random(n) < 0.5
    gains = ReferenceGains()
    together = reference_step(state, desired, SideWall(active, foot, angle), gains, 0.02)
    for i in range(n):
        alone = reference_step(
            ReferenceState(*(a[i] for a in state)),
            DesiredPoint(*(a[i] for a in desired)),
            SideWall(active[i], foot[i], angle[i]),
            gains,
            0.02,
        )
        for one, all_ in zip(alone, together, strict=True):
            np.testing.assert_allclose(one, all_[i], rtol=0.0, atol=1e-12)


DT = 0.02
NOWHERE = SideWall(np.array(False), np.zeros(2), np.array(0.0))
POINT = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)).map(np.array)
TINY = 1e-6  # [s]: a derivative to six digits
NEAR = st.floats(-0.5, 0.5)
PAIR = st.tuples(NEAR, NEAR).map(np.array)
#: Off the clamp at 1.5, where the auxiliary state no longer moves as its equation says.
LAMBDA = st.tuples(st.floats(-1.3, 1.3), st.floats(-1.3, 1.3)).map(np.array)


def _still(point) -> DesiredPoint:
    return DesiredPoint(np.asarray(point, dtype=float), np.zeros(2), np.zeros(2))


@settings(max_examples=10, deadline=None)
@given(POINT)
def test_the_reference_comes_to_a_point_that_stands(point) -> None:
    gains = ReferenceGains()
    state = reference_start(np.zeros(2), np.zeros(2))
    for _ in range(1000):
        state = reference_step(state, _still(point), NOWHERE, gains, DT)
    np.testing.assert_allclose(state.position, point, atol=1e-3)


@settings(max_examples=15, deadline=None)
@given(POINT, st.floats(-np.pi, np.pi), st.floats(0.0, 1.0))
def test_no_goal_leads_across_the_wall(goal, normal: float, ahead: float) -> None:
    """The wall stands in any direction; the reference starts on its free side and is drawn anywhere."""
    out = np.array([np.cos(normal), np.sin(normal)])
    wall = SideWall(np.array(True), np.array([0.4, -0.1]), np.array(normal))
    gains = ReferenceGains()
    state = reference_start(wall.foot + ahead * out, np.zeros(2))
    nearest = np.inf
    for _ in range(500):
        state = reference_step(state, _still(wall.foot + goal), wall, gains, DT)
        nearest = min(nearest, float((state.position - wall.foot) @ out))
    assert nearest > -1e-3


def test_a_wall_that_rises_over_the_reference_pushes_it_out() -> None:
    wall = SideWall(np.array(True), np.zeros(2), np.array(0.5 * np.pi))
    state = reference_start(np.array([0.0, -0.25]), np.array([0.2, 0.0]))
    for _ in range(300):
        state = reference_step(state, _still([0.0, -0.25]), wall, ReferenceGains(), DT)
    assert -0.005 < state.position[1] < 0.05
    off = reference_start(np.array([0.0, -0.25]), np.array([0.2, 0.0]))
    for _ in range(300):
        off = reference_step(off, _still([0.0, -0.25]), wall, ReferenceGains(), DT, envelope=False)
    assert off.position[1] == pytest.approx(-0.25, abs=0.01)


@settings(max_examples=40, deadline=None)
@given(POINT, POINT, st.booleans())
def test_the_acceleration_of_the_reference_is_bounded(goal, velocity, walled: bool) -> None:
    gains = ReferenceGains()
    state = reference_start(np.zeros(2), velocity)
    wall = SideWall(np.array(walled), np.array([0.1, 0.2]), np.array(0.3))
    after = reference_step(state, _still(goal), wall, gains, DT)
    assert np.linalg.norm(after.velocity - velocity) <= np.sqrt(2) * gains.u_max_mps2 * DT * (1 + 1e-9)


def _guidance_errors(state: ReferenceState, desired: DesiredPoint, gains: ReferenceGains) -> np.ndarray:
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
    now = DesiredPoint(point, rate, forward)
    then = DesiredPoint(point + TINY * rate, rate + TINY * forward, forward)
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
    desired = DesiredPoint(np.array([0.2, 0.0]), np.array([0.1, 0.1]), np.array([0.05, 0.0]))
    after = reference_step(state, desired, NOWHERE, gains, 0.1)
    acceleration = (after.velocity - state.velocity) / 0.1
    np.testing.assert_allclose(acceleration, [-0.418629, 0.25], atol=1e-6)
    np.testing.assert_allclose(after.position, [0.3 + 0.02 - 0.5e-2 * 0.418629, 0.5e-2 * 0.25], atol=1e-8)


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: ReferenceGains(u_max_mps2=0.2), "less than u_max_mps2"),
        (lambda: ReferenceGains(windup=AuxiliaryGains(k_mps=1.0, gamma_m=0.05)), "near or below c2_per_s"),
    ],
)
def test_gains_that_cannot_work_are_refused(build, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        build()
