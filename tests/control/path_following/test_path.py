import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msrr_control.path_following.path import Pace, PaceSpec, Path, pace_step

SHAPES = st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(0.05, 1.0)), min_size=1, max_size=4)


def _path(pieces, start=(0.3, -0.2, 0.7)) -> Path:
    return Path(np.array(start), np.array([k for k, _ in pieces]), np.array([n for _, n in pieces]))


@settings(max_examples=60, deadline=None)
@given(SHAPES)
def test_a_path_is_smooth_and_as_long_as_it_says(pieces) -> None:
    path = _path(pieces)
    s, points = path.sample(0.002)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps.sum() == pytest.approx(float(path.length), rel=1e-4)
    tangent = path.at(s[1:-1]).heading
    chord = points[2:] - points[:-2]
    off = np.angle(np.exp(1j * (np.arctan2(chord[:, 1], chord[:, 0]) - tangent)))
    assert np.abs(off).max() < 0.01


@settings(max_examples=30, deadline=None)
@given(SHAPES, st.floats(-1.0, 6.0))
def test_one_path_and_many_paths_agree(pieces, s: float) -> None:
    one = _path(pieces)
    many = Path(np.stack([one.start] * 3), np.stack([one.curvature] * 3), np.stack([one.lengths] * 3))
    for place in (s, 0.0, *np.cumsum(one.lengths), np.inf):  # anywhere, and where pieces meet
        for a, b in zip(one.at(place), many.at(np.full(3, place)), strict=True):
            np.testing.assert_array_equal(b[1], a)


def test_a_quarter_of_a_circle() -> None:
    path = Path(np.zeros(3), np.array([0.5, 0.0]), np.array([np.pi, 1.0]))
    np.testing.assert_allclose(path.at(np.pi).point, [2.0, 2.0])
    np.testing.assert_allclose(path.at(99.0).point, [2.0, 3.0])
    assert path.at(99.0).heading == pytest.approx(np.pi / 2)
    assert (float(path.arc_end), float(path.length)) == pytest.approx((np.pi, np.pi + 1.0))


def test_a_path_that_is_cut_is_its_first_part() -> None:
    path = _path([(0.5, 0.6), (0.0, 0.5), (-1.0, 0.4)])
    for s, pieces in ((-0.1, 0), (0.3, 1), (0.8, 2), (1.3, 3), (2.0, 3)):
        cut = path.until(s)
        end = min(max(s, 0.0), 1.5)
        assert float(cut.length) == pytest.approx(end)
        assert np.count_nonzero(cut.lengths) == pieces
        np.testing.assert_allclose(cut.at(np.inf).point, path.at(end).point)


def test_samples_are_no_further_apart_than_asked() -> None:
    s, points = _path([(0.0, 1.0)]).sample(0.3)
    assert (s[0], s[-1]) == (0.0, 1.0)
    assert np.diff(s).max() <= 0.3
    assert len(points) == len(s)


def test_the_pace_ramps_cruises_and_stops_at_the_end() -> None:
    path, spec, dt = Path(np.zeros(3), np.array([0.8, 0.0]), np.array([1.5, 0.3])), PaceSpec(), 0.02
    pace, speeds, points = Pace(np.array(0.0), np.array(0.0)), [], []
    for _ in range(700):
        pace, desired = pace_step(pace, path, path.at(pace.s).point, spec, dt)
        speeds.append(float(pace.speed))
        points.append(desired)
    assert max(speeds) == pytest.approx(spec.cruise_mps)
    assert speeds.index(max(speeds)) * dt == pytest.approx(spec.ramp_s, abs=0.05)
    assert float(pace.s) == pytest.approx(float(path.length), abs=1e-3)
    assert speeds[-1] == pytest.approx(0.0, abs=1e-3)
    assert np.abs(np.diff(speeds)).max() <= spec.acceleration * dt + 1e-12
    velocity = np.array([p.velocity for p in points])
    moved = np.diff([p.point for p in points], axis=0) / dt
    np.testing.assert_allclose(moved, velocity[:-1], atol=5e-3)
    acceleration = np.array([p.acceleration for p in points])[100:300]
    np.testing.assert_allclose(np.diff(velocity[100:301], axis=0) / dt, acceleration, atol=5e-3)
    ramp = np.array([p.acceleration for p in points])[1:70]
    tangent = velocity[1:70] / np.array(speeds)[1:70, None]
    np.testing.assert_allclose(np.sum(ramp * tangent, axis=1), spec.acceleration, rtol=1e-9)


def test_the_pace_waits_for_a_unit_that_is_held() -> None:
    """By its lag along the path, whichever way that leads and however far beside it the unit is."""
    spec, places = PaceSpec(), []
    for yaw, beside in ((0.0, 0.0), (1.0, 0.3), (2.5, -0.3)):
        path = Path(np.array([0.0, 0.0, yaw]), np.array([0.0]), np.array([3.0]))
        tip = beside * np.array([-np.sin(yaw), np.cos(yaw)])
        pace = Pace(np.array(0.0), np.array(0.0))
        for _ in range(500):
            pace, _ = pace_step(pace, path, tip, spec, 0.02)
        places.append(float(pace.s))
    assert spec.lag_m < places[0] <= 2.0 * spec.lag_m + 0.04
    assert places == pytest.approx([places[0]] * 3)
