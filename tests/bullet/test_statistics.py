"""Rates with their intervals, and quantiles, against known values and laws."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from msrr_bullet.statistics import Quantiles, quantile, quantiles, wilson
from msrr_scenes.random_streams import stream


@given(st.integers(1, 500), st.data(), st.sampled_from([0.8, 0.95, 0.99]))
def test_wilson_agrees_with_scipy(trials: int, data: st.DataObject, confidence: float) -> None:
    successes = data.draw(st.integers(0, trials))
    found = wilson(successes, trials, confidence)
    known = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    assert found.rate == successes / trials
    assert found.low == pytest.approx(known.low, abs=1e-12)
    assert found.high == pytest.approx(known.high, abs=1e-12)
    assert 0.0 <= found.low <= found.rate <= found.high <= 1.0


def test_wilson_at_its_ends() -> None:
    assert wilson(0, 0).model_dump() == {"rate": 0.0, "low": 0.0, "high": 1.0}
    assert wilson(0, 10).low == 0.0
    assert wilson(10, 10).high == 1.0
    assert wilson(97, 100).low == pytest.approx(0.9155, abs=1e-4)


@pytest.mark.parametrize(("k", "n", "confidence"), [(-1, 3, 0.95), (4, 3, 0.95), (1, 3, 0.0), (1, 3, 1.0)])
def test_wilson_refuses_what_cannot_be(k: int, n: int, confidence: float) -> None:
    with pytest.raises(ValueError, match="expected"):
        wilson(k, n, confidence)


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
    assert quantiles([]).model_dump() == {"p50": None, "p95": None, "max": None}


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
