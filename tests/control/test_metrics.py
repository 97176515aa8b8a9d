import numpy as np
import pytest

from msrr_control import metrics

T = np.arange(0.0, 12.0, 0.02)


def _bump(centre: float, height: float, width: float) -> np.ndarray:
    return height * np.exp(-0.5 * ((T - centre) / width) ** 2)


def test_figures_of_a_known_series() -> None:
    off = 0.01 + _bump(4.0, 0.23, 0.5)
    walled = (T >= 2.5) & (T <= 4.2)
    episode = metrics.obstacle_episode(T, off, walled)
    below = T[(T > 4.2) & (off <= 0.05)][0]
    assert (T[episode][0], T[episode][-1]) == pytest.approx((2.5, below + metrics.TAIL_S), abs=0.03)
    assert metrics.amplitude(off, episode) == pytest.approx(0.24)
    assert metrics.recovery_time(T, off, episode) == pytest.approx(
        0.5 * np.sqrt(2 * np.log(0.23 / 0.04)), abs=0.03
    )
    assert metrics.tracking_error(T, off, np.array(9.0), episode) == pytest.approx(0.01, abs=1e-4)


def test_tracking_looks_only_about_the_end_of_the_arc() -> None:
    off = _bump(7.5, 0.1, 0.1) + _bump(11.4, 0.1, 0.1)
    nothing = np.zeros(len(T), dtype=bool)
    assert metrics.tracking_error(T, off, np.array(9.0), nothing) < 1e-4
    assert metrics.tracking_error(T, off, np.array(8.0), nothing) == pytest.approx(0.1)


def test_without_obstacle_or_arc_there_is_no_figure() -> None:
    off = np.full((len(T), 2), 0.01)
    walled = np.zeros_like(off, dtype=bool)
    walled[100:200, 1] = True
    episode = metrics.obstacle_episode(T, off, walled)
    assert not episode[:, 0].any()
    np.testing.assert_array_equal(np.isnan(metrics.amplitude(off, episode)), [True, False])
    np.testing.assert_array_equal(metrics.recovery_time(T, off, episode), [np.nan, 0.0])
    assert np.isnan(metrics.tracking_error(T, off, np.array([np.nan, 9.0]), episode)).tolist() == [
        True,
        False,
    ]


def test_two_obstacles_are_one_episode_and_the_larger_counts() -> None:
    off = _bump(3.0, 0.2, 0.2) + _bump(6.0, 0.25, 0.2)
    walled = ((T > 2.4) & (T < 3.1)) | ((T > 5.4) & (T < 6.1))
    episode = metrics.obstacle_episode(T, off, walled)
    assert episode[(T > 2.5) & (T < 6.5)].all()
    assert metrics.amplitude(off, episode) == pytest.approx(0.25)


def test_deviation_is_a_distance() -> None:
    tip, desired = np.array([[3.0, 4.0]]), np.zeros((1, 2))
    assert metrics.deviation(tip, desired) == pytest.approx([5.0])
