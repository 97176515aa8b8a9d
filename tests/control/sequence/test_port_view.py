"""Where the port is, against plain geometry and against draws from the estimate's own distribution."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.docking.law import DockSetup
from msrr_control.sequence.port_view import PortView
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import LosObservation, LosStatus, PoseEstimate
from msrr_scenes.specs.control import LosSpec
from msrr_scenes.specs.vehicle import LimitsSpec

FACTS = DockSetup(
    offset=0.1,
    camera_offset=0.02,
    pin_reach=0.018,
    mouth=0.015,
    pins=(0.04, -0.04),
    los=LosSpec(),
    limits=LimitsSpec(),
    rate_hz=50.0,
)
POSE = st.builds(SE2, st.floats(-1.5, -0.15), st.floats(-0.5, 0.5), st.floats(-1.2, 1.2))


def _view(X_DU: SE2, covariance: np.ndarray | None = None, los: LosObservation | None = None) -> PortView:
    P = np.zeros((3, 3)) if covariance is None else covariance
    return PortView.of(PoseEstimate(30, X_DU, P, 10), los, FACTS, 2_000_000_010)


def _angle_from_camera(X_DU: SE2, point: tuple[float, float]) -> float:
    """Direction of a point of the dock frame as the camera sees it, left positive."""
    x, y = (X_DU @ SE2(FACTS.camera_offset, 0.0, 0.0)).inverse().act(point)
    return math.atan2(y, x)


@settings(max_examples=200, deadline=None)
@given(POSE)
def test_directions_are_those_that_the_camera_sees(X_DU: SE2) -> None:
    los, view = FACTS.los, _view(X_DU)
    assert view.bearing == pytest.approx(_angle_from_camera(X_DU, (los.setback_m, 0.0)), abs=1e-12)
    edges = [_angle_from_camera(X_DU, (los.setback_m, side * los.half_width_m)) for side in (1.0, -1.0)]
    assert view.widest_edge == pytest.approx(max(map(abs, edges)), abs=1e-12)
    assert min(edges) < view.bearing < max(edges)


def test_nothing_is_not_below_zero() -> None:
    """Reasons said that a unit was off by -0.0 deg."""
    view = _view(SE2())._replace(gap=-1e-5, lateral=-4e-5, yaw=-8e-4)
    assert str(view).startswith("0.0 mm, lateral 0.0 mm, 0.0 deg (sigma 0.0 mm,")


def test_known_directions() -> None:
    """As far beside the target's middle as before it: it lies 45 deg to the other side."""
    x = FACTS.los.setback_m - 0.4 - FACTS.camera_offset
    for side in (1.0, -1.0):
        assert _view(SE2(x, 0.4 * side, 0.0)).bearing == pytest.approx(-side * math.radians(45.0))
        straight = _view(SE2(x, 0.0, side * 0.3)).bearing
        assert math.copysign(1.0, straight) == -side


def test_edges_come_from_the_image_unless_it_is_lost() -> None:
    X_DU = SE2(-0.5, 0.0, 0.0)
    seen = LosObservation(30, 0.1, -0.4, 0.2, LosStatus.SEEN)
    by_pose = _view(X_DU).widest_edge
    assert _view(X_DU, los=seen).widest_edge == 0.4
    assert _view(X_DU, los=replace(seen, left=0.7, status=LosStatus.PREDICTED)).widest_edge == 0.7
    assert _view(X_DU, los=replace(seen, status=LosStatus.LOST)).widest_edge == by_pose


@settings(max_examples=100, deadline=None)
@given(POSE)
def test_gap_and_lateral_are_the_active_port_in_the_dock_frame(X_DU: SE2) -> None:
    port = X_DU @ SE2(FACTS.offset, 0.0, 0.0)
    view = _view(X_DU)
    assert (view.gap, view.lateral, view.yaw) == pytest.approx((-port.x, port.y, port.yaw), abs=1e-12)
    assert view.age == pytest.approx(2.0)
    assert view.off_seat(0.001) == pytest.approx(math.hypot(port.x + 0.001, port.y), abs=1e-12)
    for pin in FACTS.pins:
        assert view.gap_at(pin) == pytest.approx(-port.act((0.0, pin))[0], abs=1e-12)


@pytest.mark.parametrize("correlation", [-0.95, -0.5, 0.0, 0.5, 0.95])
@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_the_spread_of_the_port_is_that_of_draws_from_the_estimate(correlation: float, yaw: float) -> None:
    """40000 draws: the standard error of a standard deviation is 0.35 %; bounds of 2.5 % are 7 of them."""
    sigma_y, sigma_yaw = 0.003, 0.02
    P = np.zeros((3, 3))
    P[0, 0], P[1, 1], P[2, 2] = 0.002**2, sigma_y**2, sigma_yaw**2
    P[1, 2] = P[2, 1] = correlation * sigma_y * sigma_yaw
    X = SE2(-0.3, 0.02, yaw)
    view = _view(X, P)
    draws = np.random.default_rng(3).multivariate_normal(X.as_array(), P, 40_000)
    gap = -draws[:, 0] - FACTS.offset * np.cos(draws[:, 2])
    lateral = draws[:, 1] + FACTS.offset * np.sin(draws[:, 2])
    assert view.sigma_gap == pytest.approx(gap.std(), rel=0.025)
    assert view.sigma_lateral == pytest.approx(lateral.std(), rel=0.025)
    assert view.sigma_yaw == pytest.approx(sigma_yaw, rel=1e-12)


def test_errors_that_cancel_at_the_port_leave_it_certain() -> None:
    """Turned left by as much as it stands to the right: the port itself is where it is."""
    a, s = FACTS.offset, 0.02
    away = np.array([0.0, -a * s, s])
    P = np.outer(away, away)
    assert _view(SE2(-0.3, 0.0, 0.0), P).sigma_lateral == pytest.approx(0.0, abs=1e-9)
    P[1, 2] = P[2, 1] = -P[1, 2]
    assert _view(SE2(-0.3, 0.0, 0.0), P).sigma_lateral == pytest.approx(2.0 * a * s)
