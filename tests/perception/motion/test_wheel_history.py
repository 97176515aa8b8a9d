from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from msrr_perception.motion.wheel_history import WheelAngles, WheelHistory
from msrr_scenes.messages import WheelOdometry

MS = 1_000_000


def _history(*readings: tuple[int, float, float]) -> WheelHistory:
    history = WheelHistory()
    for stamp, left, right in readings:
        history.add(WheelOdometry("a", stamp * MS, left, right))
    return history


def test_angles_between_readings_are_interpolated() -> None:
    history = _history((0, 1.0, 2.0), (10, 2.0, 2.5), (20, 4.0, 2.5))
    assert history.angles_at(5 * MS) == WheelAngles(5 * MS, 1.5, 2.25, 1.0, 0.5)
    assert history.angles_at(10 * MS) == WheelAngles(10 * MS, 2.0, 2.5, 1.0, 0.5)
    assert history.angles_at(15 * MS) == WheelAngles(15 * MS, 3.0, 2.5, 3.0, 0.5)


def test_beyond_the_newest_reading_speed_is_kept_for_a_tenth_of_a_second() -> None:
    history = _history((0, 0.0, 0.0), (10, 0.1, -0.1))
    assert history.angles_at(20 * MS) == WheelAngles(20 * MS, 0.2, -0.2, 0.1, 0.1)
    late, later = history.angles_at(110 * MS), history.angles_at(5000 * MS)
    assert late is not None
    assert later is not None
    np.testing.assert_allclose([late.left, later.left], [1.1, 1.1])


@pytest.mark.parametrize("period", [20, 100, 500, 1000])
def test_wheels_that_accelerate_are_off_by_what_is_said(period: int) -> None:
    """Between readings, and after the newest one for as long as the last speed is assumed to last."""
    history = _history(*((t, (1e-3 * t) ** 2, -2.0 * (1e-3 * t) ** 2) for t in range(0, 6 * period, period)))
    for stamp in np.linspace(0, max(6 * period, 5 * period + 100) * MS, 200).astype(int).tolist():
        t, off, angles = 1e-9 * stamp, history.off_by(stamp), history.angles_at(stamp)
        assert angles is not None
        assert abs(angles.left - t * t) == pytest.approx(2.0 * off, abs=1e-12)
        assert abs(angles.right + 2.0 * t * t) == pytest.approx(4.0 * off, abs=1e-12)
    assert history.off_by(2 * period * MS) == 0.0


def test_at_dense_and_silent_readings_the_wheels_are_where_they_are_said_to_be() -> None:
    dense, silent = _history((0, 0.0, 0.0), (10, 0.1, 0.1)), _history((0, 1.0, 1.0), (9000, 1.0, 1.0))
    assert dense.off_by(5 * MS) == dense.off_by(20 * MS) == 0.0
    assert dense.off_by(60 * MS) == pytest.approx(0.5 * 0.06 * 0.05)
    assert dense.off_by(500 * MS) == 0.0, "the wheels are taken to stand"
    assert silent.off_by(4000 * MS) == silent.off_by(9050 * MS) == 0.0
    assert _history((50, 0.0, 0.0)).off_by(80 * MS) == _history().off_by(0) == 0.0


def test_before_the_first_reading_the_wheels_stand() -> None:
    assert _history().angles_at(0) is None
    assert _history().angles_between(0, 10) == []
    history = _history((10, 3.0, 4.0))
    assert history.angles_at(0) == WheelAngles(0, 3.0, 4.0)
    assert history.angles_at(50 * MS) == WheelAngles(50 * MS, 3.0, 4.0)


def test_late_readings_find_their_place_and_repeated_ones_do_nothing() -> None:
    ordered = _history((0, 0.0, 0.0), (10, 1.0, 0.0), (20, 1.5, 0.0))
    mixed = WheelHistory()
    newest = [
        mixed.add(WheelOdometry("a", s * MS, left, 0.0))
        for s, left in [(0, 0.0), (20, 1.5), (10, 1.0), (10, 9.0)]
    ]
    assert newest == [True, True, False, False]
    assert mixed.angles_between(-1, 20 * MS) == ordered.angles_between(-1, 20 * MS)
    for t in range(0, 40, 3):
        assert mixed.angles_at(t * MS) == ordered.angles_at(t * MS)


def test_readings_in_any_order_tell_the_same() -> None:
    rows = [(0, 0.0, 0.0), (10, 1.0, 1.0), (15, 0.9, 1.2), (20, 1.5, 0.8)]
    ordered = _history(*rows)
    for order in permutations(rows):
        assert [_history(*order).angles_at(t * MS) for t in range(25)] == [
            ordered.angles_at(t * MS) for t in range(25)
        ]


def test_late_readings_tell_the_same_behind_one_that_is_older_than_all_known() -> None:
    """What turned before it is forgotten; the right wheel turns back at 40 ms, or it is learned at 45 ms."""
    rows = [(0, 0.0, 0.0), (10, 1.0, 1.0), (20, 1.5, 2.0), (30, 2.0, 3.0), (40, 2.5, 2.5), (50, 3.0, 2.2)]
    known, older = _history(*rows), _history(*rows)
    for history in (known, older):
        history.forget_before(20 * MS)
    older.add(WheelOdometry("a", 15 * MS, 1.2, 1.5))
    for history in (known, older):
        history.add(WheelOdometry("a", 35 * MS, 2.2, 3.2))
        assert history.newest_stamp(60 * MS) == 50 * MS
    for t in range(20, 60, 5):
        assert older.angles_at(t * MS) == known.angles_at(t * MS)
    older.forget_before(35 * MS)
    older.add(WheelOdometry("a", 45 * MS, 2.8, 2.6))
    known.add(WheelOdometry("a", 45 * MS, 2.8, 2.6))
    for t in range(35, 60, 5):
        assert older.angles_at(t * MS) == known.angles_at(t * MS)


def test_the_way_lists_readings_strictly_between_and_the_end() -> None:
    history = _history((0, 0.0, 0.0), (10, 1.0, 0.0), (20, 2.0, 0.0), (30, 3.0, 0.0))
    assert [w.stamp_ns // MS for w in history.angles_between(0, 25 * MS)] == [10, 20, 25]
    assert [w.stamp_ns // MS for w in history.angles_between(10 * MS, 20 * MS)] == [20]
    assert [w.stamp_ns // MS for w in history.angles_between(12 * MS, 14 * MS)] == [14]
    assert history.newest_stamp(25 * MS) == 20 * MS
    assert history.newest_stamp(-1) is None


def test_forgetting_keeps_what_later_instants_need() -> None:
    history = _history((0, 0.0, 0.0), (10, 1.0, 0.0), (20, 2.0, 0.0), (30, 3.0, 0.0))
    before = history.angles_at(15 * MS)
    history.forget_before(15 * MS)
    assert [w.stamp_ns // MS for w in history.angles_between(-1, 30 * MS)] == [10, 20, 30]
    assert history.angles_at(15 * MS) == before


def test_a_wheel_that_turns_back_takes_up_the_play_of_its_gear_again() -> None:
    history = _history((0, 0.0, 0.0), (10, 0.5, 0.0), (20, 1.5, 0.0), (30, 1.5, 0.1), (40, 1.2, 0.3))
    for ms, left, right in ((20, 1.5, 0.0), (30, 1.5, 0.1), (40, 0.3, 0.3)):
        angles = history.angles_at(ms * MS)
        assert angles is not None
        assert (angles.since_left, angles.since_right) == pytest.approx((left, right))
