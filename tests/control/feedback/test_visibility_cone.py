import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.feedback.visibility_cone import (
    ConeGains,
    ConeState,
    cone_force,
    cone_step,
    edge_angles,
    edge_force,
)
from msrr_scenes.specs.control import LosSpec

LOS = LosSpec()
ANGLES = st.floats(-3.1, 3.1)


@settings(max_examples=200, deadline=None)
@given(ANGLES)
def test_no_force_inside_the_inner_cone(angle: float) -> None:
    force = float(edge_force(np.array(angle), LOS.inner, LOS.outer))
    assert 0.0 <= force <= 1.0
    if abs(angle) <= LOS.inner:
        assert force == 0.0
    if abs(angle) >= LOS.outer:
        assert force == pytest.approx(1.0)


def test_the_force_rises_with_the_angle_without_a_jump() -> None:
    angles = np.linspace(0.0, 0.7, 20_001)
    force = edge_force(angles, LOS.inner, LOS.outer)
    assert np.all(np.diff(force) >= 0.0)
    assert np.max(np.diff(force)) < 1e-3
    np.testing.assert_array_equal(force, edge_force(-angles, LOS.inner, LOS.outer))


@settings(max_examples=100, deadline=None)
@given(st.floats(0.36, 0.5), st.floats(-0.3, 0.3))
def test_an_edge_on_the_left_turns_left_and_holds_back(angle: float, yaw: float) -> None:
    """The body-frame correction: +y for a left edge, never +x."""
    force = cone_force(np.array([angle, 0.1]), np.array(0.0), LOS, 0.1)
    assert force[1] > 0.0
    assert force[0] < 0.0
    turned = cone_force(np.array([angle, 0.1]), np.array(yaw), LOS, 0.1)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(force))


@settings(max_examples=100, deadline=None)
@given(ANGLES, ANGLES, st.floats(-1.0, 1.0))
def test_the_mirrored_view_gives_the_mirrored_force(left: float, right: float, yaw: float) -> None:
    force = cone_force(np.array([left, right]), np.array(yaw), LOS, 0.1)
    mirrored = cone_force(np.array([-right, -left]), np.array(-yaw), LOS, 0.1)
    np.testing.assert_allclose(mirrored, force * [1.0, -1.0], atol=1e-12)


def test_edge_angles_of_an_aligned_unit_at_contact() -> None:
    """17 deg with the design's marker: atan(b / (l + s_b))."""
    at_contact = edge_angles(np.array([-0.1, 0.0, 0.0]), LOS, 0.0)
    np.testing.assert_allclose(at_contact, [LOS.angle_at_contact(0.1), -LOS.angle_at_contact(0.1)])
    assert np.degrees(at_contact[0]) == pytest.approx(17.0, abs=0.1)


def test_edge_angles_see_the_camera_where_it_is() -> None:
    pose = np.array([-0.5, 0.03, 0.2])
    camera = pose[:2] + 0.07 * np.array([np.cos(0.2), np.sin(0.2)])
    to_left = np.array([LOS.setback_m, LOS.half_width_m]) - camera
    expected = np.arctan2(to_left[1], to_left[0]) - 0.2
    assert edge_angles(pose, LOS, 0.07)[0] == pytest.approx(expected)


def test_filters_settle_at_the_reach_and_report_their_rate() -> None:
    gains = ConeGains()
    state = ConeState(np.zeros(2), np.zeros(2))
    force = np.array([-0.1, 1.0])
    shifts = [state.shift]
    rates = []
    for _ in range(500):
        state, rate = cone_step(state, force, gains, 0.02)
        shifts.append(state.shift)
        rates.append(rate)
    np.testing.assert_allclose(state.shift, gains.reach_m * force, atol=1e-9)
    np.testing.assert_allclose(np.diff(shifts, axis=0) / 0.02, rates, atol=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, 1e4))
def test_filters_are_stable_for_any_step(dt: float) -> None:
    gains = ConeGains()
    state = ConeState(np.zeros(2), np.zeros(2))
    for _ in range(20):
        state, _ = cone_step(state, np.array([2.0, -2.0]), gains, dt)
        assert np.all(np.abs(state.shift) <= 2.0 * gains.reach_m + 1e-12)
