"""SE(2): the laws of a group, exp and log, and poses worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from msrr_scenes.geometry.se2 import SE2, wrap_angle

metres = st.floats(-10.0, 10.0)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(SE2, metres, metres, angles)


def close(a: SE2, b: SE2, tolerance: float = 1e-9) -> bool:
    return math.hypot(a.x - b.x, a.y - b.y) < tolerance and abs(wrap_angle(a.yaw - b.yaw)) < tolerance


@given(poses, poses, poses)
def test_composition_is_associative(a: SE2, b: SE2, c: SE2) -> None:
    assert close((a @ b) @ c, a @ (b @ c))


@given(poses)
def test_identity_and_inverse(a: SE2) -> None:
    assert close(a @ SE2(), a)
    assert close(SE2() @ a, a)
    assert close(a @ a.inverse(), SE2())
    assert close(a.inverse() @ a, SE2())


@given(poses, poses)
def test_acting_is_a_homomorphism(a: SE2, b: SE2) -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [-2.0, 3.0]])
    np.testing.assert_allclose((a @ b).act(points), a.act(b.act(points)), atol=1e-9)


@given(metres, metres, st.floats(-3.1, 3.1))
def test_log_undoes_exp(dx: float, dy: float, dyaw: float) -> None:
    np.testing.assert_allclose(SE2.exp(dx, dy, dyaw).log(), [dx, dy, dyaw], atol=1e-8)


@given(metres, metres, st.floats(-2e-6, 2e-6))
def test_exp_has_no_seam_where_its_series_begins(dx: float, dy: float, dyaw: float) -> None:
    midpoint = SE2(0.0, 0.0, 0.5 * dyaw).act([dx, dy])  # exact to third order in the turn
    pose = SE2.exp(dx, dy, dyaw)
    np.testing.assert_allclose(pose.translation, midpoint, atol=1e-10)


@given(metres, metres, st.floats(-3.0, 3.0))
def test_exp_is_a_one_parameter_group(dx: float, dy: float, dyaw: float) -> None:
    half = SE2.exp(0.5 * dx, 0.5 * dy, 0.5 * dyaw)
    assert close(half @ half, SE2.exp(dx, dy, dyaw), 1e-8)


def test_quarter_circle() -> None:
    assert close(SE2.exp(math.pi / 2, 0.0, math.pi / 2), SE2(1.0, 1.0, math.pi / 2))


def test_composition_by_hand() -> None:
    assert close(SE2(1.0, 2.0, math.pi / 2) @ SE2(3.0, 0.0, math.pi / 2), SE2(1.0, 5.0, math.pi))


@given(st.floats(-1e4, 1e4))
@example(math.pi)
@example(-math.pi)
@example(3.0 * math.pi)
def test_wrapped_angles_lie_in_the_half_open_interval(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert SE2(0.0, 0.0, angle).yaw == wrapped
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


def test_a_covariance_is_rotated_as_the_errors_are() -> None:
    quarter = SE2(5.0, -3.0, math.pi / 2.0)
    error_B, error_A = np.array([0.2, 0.1, 0.3]), np.array([-0.1, 0.2, 0.3])
    covariance = quarter.rotate_covariance(np.outer(error_B, error_B))
    np.testing.assert_allclose(covariance, np.outer(error_A, error_A), atol=1e-15)
