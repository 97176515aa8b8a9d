import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from msrr_control.path_following.obstacle_forces import (
    Obstacles,
    RepulsionGains,
    SpringGains,
    repulsion,
    spring_force,
)


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 1.0), st.floats(-np.pi, np.pi))
def test_the_spring_repels_everywhere_and_is_bounded(rho: float, angle: float) -> None:
    gains = SpringGains()
    away = np.array([np.cos(angle), np.sin(angle)])
    here = Obstacles(np.array([[0.2, 0.3]]), np.array([True]))
    force = spring_force(here.centre[0] + rho * away, here, gains)
    push = float(-force @ away)  # the velocity subtracts it
    assert np.linalg.norm(force) <= gains.k_r_mps * (1 + 1e-9)
    assert (push > 0.0) == (1e-6 < rho < gains.far_m - 1e-9) or rho <= 1e-6 or abs(rho - gains.far_m) < 1e-6
    gone = here._replace(present=np.array([False]))
    assert not spring_force(here.centre[0] + rho * away, gone, gains).any()


@given(st.floats(0.0, 2.0), st.floats(-np.pi, np.pi))
def test_the_potential_pushes_straight_away_and_ends_at_its_range(distance: float, angle: float) -> None:
    gains = RepulsionGains()
    away = np.array([np.cos(angle), np.sin(angle)])
    # In the origin: elsewhere the difference to a point 1e-12 m away has no direction left to test.
    one = Obstacles(np.zeros((1, 2)), np.array([True]))
    tip = distance * away
    pushed = repulsion(tip, one, gains)
    assert np.isfinite(pushed).all()
    assert pushed @ away >= 0.0
    assert abs(pushed @ [-away[1], away[0]]) <= 1e-9 * (1.0 + np.hypot(*pushed))
    if np.hypot(*tip) >= gains.range_m:
        np.testing.assert_array_equal(pushed, 0.0)


def test_the_spring_rises_between_its_two_distances() -> None:
    """Eq. 15: nothing at the far one, k_r tanh(tan(pi/4)) half-way, all of k_r from the near one on."""
    gains, here = SpringGains(), Obstacles(np.zeros((1, 2)), np.array([True]))
    for share, part in ((0.0, 0.0), (0.5, np.tanh(1.0)), (1.0, 1.0), (1.2, 1.0)):
        rho = gains.far_m + share * (gains.near_m - gains.far_m)
        force = spring_force(np.array([rho, 0.0]), here, gains)
        assert force == pytest.approx([-part * gains.k_r_mps, 0.0], abs=1e-9)


@pytest.mark.parametrize("rho", [0.15, 0.3, 0.6])
def test_the_repulsion_is_the_slope_of_khatibs_potential(rho: float) -> None:
    gains, here, h = RepulsionGains(), Obstacles(np.zeros((1, 2)), np.array([True])), 1e-5

    def potential(distance: float) -> float:
        return 0.5 * gains.eta * (1.0 / distance - 1.0 / gains.range_m) ** 2

    slope = (potential(rho + h) - potential(rho - h)) / (2.0 * h)
    assert repulsion(np.array([rho, 0.0]), here, gains) == pytest.approx([-slope, 0.0], rel=1e-6)


def test_absent_obstacles_do_not_push() -> None:
    tip = np.array([0.1, 0.0])
    none = Obstacles(np.zeros((1, 2)), np.array([False]))
    np.testing.assert_array_equal(repulsion(tip, none, RepulsionGains()), 0.0)


def test_a_potential_without_a_range_is_refused() -> None:
    with pytest.raises(ValidationError, match="less than range_m"):
        RepulsionGains(range_m=0.1, nearest_m=0.2)


def test_a_spring_without_a_range_is_refused() -> None:
    with pytest.raises(ValueError, match="less than far_m"):
        SpringGains(near_m=0.7)
