"""The few statistics that a sweep reports: an interval for a rate, and quantiles."""

from __future__ import annotations

import math
from collections.abc import Iterable
from statistics import NormalDist

import numpy as np
from pydantic import BaseModel, ConfigDict


class Rate(BaseModel):
    """A success rate with its Wilson interval; all in 0 .. 1."""

    model_config = ConfigDict(frozen=True)

    rate: float
    low: float
    high: float


class Quantiles(BaseModel):
    """Median, 95th percentile and largest of some values; all None when there are no values."""

    model_config = ConfigDict(frozen=True)

    p50: float | None
    p95: float | None
    max: float | None


def wilson(successes: int, trials: int, confidence: float = 0.95) -> Rate:
    """Return the success rate with Wilson's score interval.

    It keeps its level for rates near 0 and 1 and for few trials, where the usual normal interval collapses.
    Source: Wilson, Probable Inference, the Law of Succession, and Statistical Inference, JASA 22 (1927).

    Args:
        successes: At most ``trials``.
        trials: Without any, the rate is unknown: 0 with the interval 0 .. 1.
        confidence: Two-sided level.

    Raises:
        ValueError: Counts or level out of range.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"expected 0 <= successes <= trials, found {successes} of {trials}")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"expected a confidence between 0 and 1, found {confidence}")
    if trials == 0:
        return Rate(rate=0.0, low=0.0, high=1.0)
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    p, n = successes / trials, float(trials)
    centre = (p + z * z / (2.0 * n)) / (1.0 + z * z / n)
    half = z / (1.0 + z * z / n) * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
    # At 0 and 1 the bound is exact; rounding would leave it a hair inside.
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == trials else min(1.0, centre + half)
    return Rate(rate=p, low=low, high=high)


def quantiles(values: Iterable[float]) -> Quantiles:
    """Return median, 95th percentile (linear between order statistics) and largest of ``values``."""
    array = np.fromiter(values, dtype=np.float64)
    if array.size == 0:
        return Quantiles(p50=None, p95=None, max=None)
    p50, p95 = (float(q) for q in np.quantile(array, [0.5, 0.95]))
    return Quantiles(p50=p50, p95=p95, max=float(array.max()))
