import numpy as np
import pytest

from msrr_control.path_following.path import Path
from msrr_control.studies import metrics

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


def test_lag_is_a_deviation_and_no_distance_from_the_path() -> None:
    """Half a metre behind the desired point, on the path: a quarter circle of radius 1 m and a line."""
    path = Path(np.array([0.0, 0.0, 0.0]), np.array([1.0, 0.0]), np.array([0.5 * np.pi, 0.4]))
    s = np.linspace(0.0, float(path.length) - 0.5, 40)
    tip, desired = path.at(s).point, path.at(s + 0.5).point
    assert metrics.deviation(tip, desired).min() > 0.49
    assert metrics.from_path(tip, path).max() < 1e-12


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_the_distance_from_a_path_is_that_to_arc_lead_in_and_ends(turn: float) -> None:
    path = Path(np.array([0.0, 0.0, 0.0]), np.array([turn, 0.0]), np.array([0.5 * np.pi, 0.4]))
    cases = {
        (0.8 * np.sqrt(0.5), 1.0 - 0.8 * np.sqrt(0.5)): 0.2,  # inside of the circle about (0, 1)
        (0.0, 1.0): 1.0,  # in its middle
        (1.3 * np.sqrt(0.5), 1.0 - 1.3 * np.sqrt(0.5)): 0.3,  # outside of it
        (1.1, 1.2): 0.1,  # beside the lead-in, which leads from (1, 1) to (1, 1.4)
        (1.0, 1.7): 0.3,  # beyond its end
        (-0.3, 0.4): 0.5,  # before the beginning
        (-0.6, 1.8): np.hypot(1.6, 0.4),  # where only the full circle would be near
    }
    points = np.array([(x, turn * y) for x, y in cases])
    np.testing.assert_allclose(metrics.from_path(points, path), list(cases.values()), atol=1e-12)


def test_a_line_through_points_of_a_path_stands_for_it() -> None:
    """Random points about many paths, each by its own, against the finely sampled curves."""
    rng = np.random.default_rng(2)
    turn = rng.uniform(-1.0, 1.0, 20)
    lengths = np.stack([rng.uniform(0.5, 2.4, 20), np.full(20, 0.3)], axis=-1)
    path = Path(rng.uniform(-1.0, 1.0, (20, 3)), np.stack([turn, np.zeros(20)], axis=-1), lengths)
    tip = rng.uniform(-2.0, 2.0, (30, 20, 2))
    exact = metrics.from_path(tip, path)
    assert exact.shape == (30, 20)
    for i in range(20):
        one = Path(path.start[i], path.curvature[i], path.lengths[i])
        _, line = one.sample(0.004)
        np.testing.assert_allclose(metrics.from_line(tip[:, i], line), exact[:, i], atol=3e-6)
    assert metrics.from_line(np.array([[3.0, 4.0]]), np.zeros((1, 2))) == pytest.approx([5.0])
    assert metrics.from_line(np.array([[3.0, 4.0]]), np.zeros((2, 2))) == pytest.approx([5.0])


def test_a_series_that_ends_at_the_obstacle_has_no_recovery() -> None:
    """Whatever the distance does to the end: it grows, stays, or has begun to fall."""
    growing, falling = 0.1 * T, 0.01 + 0.3 * np.exp(-0.5 * ((T - 9.0) / 3.0) ** 2)
    off = np.stack([growing, np.full(len(T), 0.3), falling], axis=-1)
    walled = np.broadcast_to((T >= 2.0)[:, None], off.shape)
    episode = metrics.obstacle_episode(T, off, walled)
    assert np.isinf(metrics.recovery_time(T, off, episode)).all()


def test_a_unit_that_leaves_the_path_again_for_good_has_not_recovered() -> None:
    """It came back for less time than counts as the end of its episode."""
    off = np.stack([0.01 + _bump(4.0, 0.23, 0.5), 0.01 + _bump(4.0, 0.23, 0.5)], axis=-1)
    off[T > 6.0, 1] = 0.3
    walled = np.broadcast_to(((T >= 2.5) & (T <= 4.2))[:, None], off.shape)
    episode = metrics.obstacle_episode(T, off, walled)
    assert not episode[-1].any()
    np.testing.assert_array_equal(np.isinf(metrics.recovery_time(T, off, episode)), [False, True])
