"""Estimates with their intervals: of a share, and of a quantile."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msrr_bullet.statistics import Rate
from msrr_bullet.studies.model import Measured
from msrr_bullet.studies.open_quantiles import quantile


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its 95 % interval.

    ``high`` is infinite where there are too few trials to bound it; all three may be where too many never
    came to what is timed.
    """

    value: float
    low: float
    high: float

    def apart(self, other: Estimate) -> bool:
        """Say whether the two intervals have nothing in common."""
        return self.low > other.high or self.high < other.low


def of_rate(rate: Rate) -> Estimate:
    """Return a share and its Wilson interval."""
    return Estimate(rate.rate, rate.low, rate.high)


def of_quantile(measured: Measured, q: float) -> Estimate | None:
    """Return a quantile and its interval; None without values."""
    if not measured.values:
        return None
    return Estimate(quantile(measured.values, q), *quantile_interval(measured.values, q))


def quantile_interval(values: Sequence[float], q: float, confidence: float = 0.95) -> tuple[float, float]:
    """Return an interval for a quantile, between two order statistics, whatever the values' distribution is.

    How many of n values lie below the true quantile is binomial (n, q), which says between which two of the
    sorted values it lies. Source: Conover, Practical Nonparametric Statistics, section 3.2.

    Returns:
        Lower and upper bound, infinite on a side on which there are too few values.
    """
    ordered, n = np.sort(np.asarray(values, dtype=np.float64)), len(values)
    k = np.arange(n + 1)
    log_choose = np.array([math.lgamma(n + 1) - math.lgamma(i + 1) - math.lgamma(n - i + 1) for i in k])
    below = np.cumsum(np.exp(log_choose + k * math.log(q) + (n - k) * math.log1p(-q)))
    tail = 0.5 * (1.0 - confidence)
    # The largest r with P(fewer than r below) <= tail, and the smallest s with P(s or more below) <= tail.
    r = int(np.searchsorted(below, tail, side="right"))
    s = int(np.searchsorted(below, 1.0 - tail, side="left")) + 1
    return (
        float(ordered[r - 1]) if r >= 1 else -math.inf,
        float(ordered[s - 1]) if s <= n else math.inf,
    )
