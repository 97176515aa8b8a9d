"""Paired comparisons: their level, their power, and what becomes of infinite values."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from msrr_bullet.paired import mcnemar, paired_difference
from msrr_scenes.random_streams import stream


def test_only_the_trials_that_differ_count() -> None:
    """8 against 0 trials of 200: two-sided 2 / 2^8, though the rates' intervals overlap."""
    first, second = np.ones(200, dtype=bool), np.ones(200, dtype=bool)
    first[:40], second[:48] = False, False
    found = mcnemar(first, second)
    assert found == (8, 0, 2.0 / 2.0**8)
    assert mcnemar(second, first) == (0, 8, found.p)
    assert mcnemar(first, first) == (0, 0, 1.0)
    second[:5] = True
    assert mcnemar(first, second).p == pytest.approx(binomtest(5, 13).pvalue)


def test_trials_are_drawn_as_one_by_one_however_many_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    x, y = stream(3, "test/paired").uniform(size=(2, 37))
    whole = paired_difference(x, y, 0.5)
    monkeypatch.setattr("msrr_bullet.paired._DRAWN_AT_ONCE", 100)
    assert paired_difference(x, y, 0.5) == whole


def test_equal_ways_are_told_apart_as_rarely_as_the_level_says() -> None:
    """Of 300 pairs of samples without a difference at most 5 % may be told apart by either test; with the
    seed fixed no chance is involved, and 8 % is 2.4 standard deviations above."""
    rng = stream(1, "test/paired")
    flagged = bounded = 0
    for _ in range(300):
        hard = rng.uniform(0.2, 1.0, 100)  # what the trials have in common
        a, b = (rng.uniform(size=100) < hard for _ in range(2))
        flagged += mcnemar(a, b).p < 0.05
        x, y = (hard + 0.1 * rng.standard_normal(100) for _ in range(2))
        difference = paired_difference(x, y, 0.5, resamples=400)
        bounded += difference.is_apart
    assert flagged <= 0.08 * 300
    assert bounded <= 0.08 * 300


def test_a_tail_of_forty_equal_trials_is_told_apart_as_rarely_as_the_level_says() -> None:
    rng = stream(3, "test/paired")
    apart = 0
    for _ in range(300):
        x, y = np.abs(rng.standard_normal((2, 40)))
        apart += paired_difference(x, y, 0.95, resamples=400).is_apart
    assert apart <= 0.08 * 300


@pytest.mark.parametrize(("q", "least"), [(0.05, 40), (0.5, 9), (0.95, 40)])
def test_too_few_trials_tell_nothing(q: float, least: int) -> None:
    """Even where one sample is a metre above the other: of ten equal pairs the bootstrap of a 95th percentile
    tells more than 10 % apart."""
    x = np.ones(least)
    few, enough = (paired_difference(x[:n] + 1.0, x[:n], q) for n in (least - 1, least))
    assert (few.value, few.interval, few.is_apart) == (1.0, None, False)
    assert (enough.value, enough.interval, enough.is_apart) == (1.0, (1.0, 1.0), True)


@pytest.mark.parametrize("q", [0.05, 0.5, 0.95])
def test_a_shift_that_all_trials_share_is_found(q: float) -> None:
    """A millimetre between samples that scatter by a hundred: apart the intervals would overlap."""
    x = stream(2, "test/paired").normal(0.0, 0.1, 200)
    value, interval = paired_difference(x + 0.001, x, q)
    assert (value, *(interval or ())) == pytest.approx((0.001, 0.001, 0.001))


def test_infinite_values_are_the_largest_and_do_not_differ() -> None:
    never = np.full(40, math.inf)
    assert paired_difference(never, never, 0.95) == (0.0, (0.0, 0.0))
    assert paired_difference(never, np.ones(40), 0.5) == (math.inf, (math.inf, math.inf))
    few = np.ones(40)
    few[:3] = math.inf
    assert paired_difference(few, np.ones(40), 0.95) == (math.inf, (0.0, math.inf))


def test_infinite_values_leave_a_number_where_the_quantile_is_one_of_the_values() -> None:
    """The median of nine is the fifth of them, whatever the sixth is: the interval is never NaN."""
    some = np.array([1.0, 2.0, 3.0, 4.0, 5.0, math.inf, math.inf, math.inf, math.inf])
    assert paired_difference(some, np.arange(1.0, 10.0), 0.5) == (0.0, (0.0, math.inf))


def test_samples_of_other_trials_are_refused() -> None:
    with pytest.raises(ValueError, match="found 3 and 2"):
        paired_difference(np.ones(3), np.ones(2), 0.5)
    with pytest.raises(ValueError, match="found 0 and 0"):
        paired_difference(np.ones(0), np.ones(0), 0.5)
