"""Rates with their intervals, and quantiles, against known values and laws."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from msrr_bullet.statistics import Quantiles, interval_text, quantile, quantile_interval, quantiles, wilson
from msrr_scenes.random_streams import stream


@given(st.integers(1, 500), st.data())
def test_wilson_agrees_with_scipy(trials: int, data: st.DataObject) -> None:
    successes = data.draw(st.integers(0, trials))
    found = wilson(successes, trials)
    known = binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    assert found.rate == successes / trials
    assert found.low == pytest.approx(known.low, abs=1e-12)
    assert found.high == pytest.approx(known.high, abs=1e-12)
    assert 0.0 <= found.low <= found.rate <= found.high <= 1.0


def test_wilson_at_its_ends() -> None:
    assert wilson(0, 0).model_dump() == {"rate": 0.0, "low": 0.0, "high": 1.0}
    assert wilson(0, 10).low == 0.0
    assert wilson(10, 10).high == 1.0
    assert wilson(97, 100).low == pytest.approx(0.9155, abs=1e-4)


@pytest.mark.parametrize("k", [-1, 4])
def test_wilson_refuses_what_cannot_be(k: int) -> None:
    with pytest.raises(ValueError, match="expected"):
        wilson(k, 3)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=50))
def test_quantiles_are_ordered_and_of_the_sample(values: list[float]) -> None:
    q = quantiles(values)
    assert q.p50 is not None
    assert q.p95 is not None
    assert q.max == max(values)
    assert min(values) <= q.p50 <= q.p95 + 1e-9 * abs(q.p95)
    assert q.p95 <= max(values) + 1e-9 * abs(max(values))


def test_quantiles_by_hand() -> None:
    q = quantiles(float(i) for i in range(101))
    assert (q.p50, q.p95, q.max) == (50.0, 95.0, 100.0)
    empty = quantiles([], independent=True)
    assert (empty.p50, empty.p95, empty.max) == (None, None, None)
    assert (empty.p50_interval, empty.p95_interval) == ((None, None), (None, None))


def test_quantiles_may_be_infinite() -> None:
    few, many = [1.0] * 19 + [math.inf], [1.0] * 10 + [math.inf] * 10
    assert [quantile(few, q) for q in (0.5, 0.94, 0.95, 1.0)] == [1.0, 1.0, math.inf, math.inf]
    assert quantile([1.0, 2.0, math.inf], 0.5) == 2.0
    assert [quantile(many, q) for q in (0.25, 0.5, 0.75)] == [1.0, math.inf, math.inf]
    found = quantiles(few)
    assert (found.p50, found.p95, found.max) == (1.0, math.inf, math.inf)
    assert Quantiles.model_validate_json(found.model_dump_json()) == found


def test_a_quantile_of_finite_values_is_numpys() -> None:
    values = list(stream(1, "test/quantile").uniform(size=37))
    assert quantile(values, 0.95) == np.quantile(values, 0.95)


def test_the_interval_covers_as_it_claims() -> None:
    # 2,000 sweeps of 60 trials at rate 0.95: by exact summation Wilson's interval covers in 0.9703 of them,
    # standard error 0.0038; a right program is outside 0.955 .. 0.985 with odds of 1 to 10,000.
    rng = np.random.default_rng(0)
    covered = [r.low <= 0.95 <= r.high for r in (wilson(int(k), 60) for k in rng.binomial(60, 0.95, 2000))]
    assert 0.955 < float(np.mean(covered)) < 0.985


@given(st.integers(1, 400), st.floats(0.05, 0.95))
def test_the_bounds_of_a_quantile_are_the_closest_that_keep_the_level(n: int, q: float) -> None:
    # Of the values 1 .. n, order statistic k is k; the number of values below the quantile is binomial.
    low, high = quantile_interval(np.arange(1.0, n + 1.0), q)
    miss, below = 0.5 * (1.0 - 0.95), binom(n, q)
    k = np.arange(n + 2)
    # The quantile is under value k, and over it, with odds of at most `miss`.
    assert np.array_equal(below.cdf(k - 1) <= miss, k <= (low or 0))
    assert np.array_equal(below.sf(k - 1) <= miss, k >= (high or n + 1))


def test_the_interval_of_a_quantile_follows_the_values_wherever_they_go() -> None:
    values = stream(2, "test/quantile_interval").normal(size=100)
    low, high = quantile_interval(values, 0.5)
    assert low is not None
    assert high is not None
    assert low < np.median(values) < high
    assert quantile_interval(4.0 * values, 0.5) == (4.0 * low, 4.0 * high)  # exact in binary
    assert quantile_interval(-values, 0.5) == (-high, -low)
    assert quantile_interval([1.0] * 90 + [math.inf] * 10, 0.95) == (1.0, math.inf)


def test_the_interval_of_a_quantile_covers_as_it_claims() -> None:
    # 2,000 sweeps of 100 trials: by exact summation the interval of the 95 % quantile covers in 0.9826 of
    # them, standard error 0.0029; a right program is outside 0.971 .. 0.994 with odds of 1 to 10,000.
    rng = stream(3, "test/quantile_interval")
    covered = 0
    for values in rng.exponential(size=(2000, 100)):
        low, high = quantile_interval(values, 0.95)
        covered += low is not None and high is not None and low <= math.log(20.0) <= high
    assert 0.971 < covered / 2000 < 0.994


@pytest.mark.parametrize("q", [0.0, 1.0])
def test_the_interval_of_a_quantile_refuses_what_cannot_be(q: float) -> None:
    with pytest.raises(ValueError, match="expected"):
        quantile_interval([1.0, 2.0], q)


def test_an_interval_as_text() -> None:
    assert interval_text((None, None)) == ""
    assert interval_text((1.234, None)) == "at least 1.23"
    assert interval_text((1.234, 5.0), 1) == "1.2 .. 5.0"
    assert interval_text((0.001, 0.002)) == ""
