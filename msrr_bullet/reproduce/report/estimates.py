"""Rates and quantiles with their 95 % intervals, as the figures of the ablations show them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from msrr_bullet.statistics import Rate, quantile
from msrr_bullet.studies.measures import PATH_FOLLOWING, Measure
from msrr_bullet.studies.model import FlagName, Measured, Row


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its 95 % interval.

    The upper bound is infinite where there are too few trials to bound the value. All three may be infinite
    where a timed event never happened in too many trials.
    """

    value: float
    low: float
    high: float


def estimate_rate(row: Row, name: FlagName) -> Estimate | None:
    """Return one of the rates of a row with its Wilson interval; None if the row does not have it."""
    rate: Rate | None = getattr(row, name)
    return Estimate(rate.rate, rate.low, rate.high) if rate is not None else None


def estimate_measure(row: Row, measure: Measure, q: float) -> Estimate | None:
    """Return a quantile of a measure of a row with its interval.

    It is None without values, and for the path following of a law that drives through the obstacle in more
    than half of the trials: such a law swings out little and recovers at once, which is no merit.
    """
    if measure in PATH_FOLLOWING and row.success.rate < 0.5:
        return None
    return estimate_quantile(row.measures[measure.key], q)


def estimate_quantile(measured: Measured, q: float) -> Estimate | None:
    """Return a quantile with its interval; None without values."""
    if not measured.values:
        return None
    return Estimate(quantile(measured.values, q), *quantile_interval(measured.values, q))


def quantile_interval(values: Sequence[float], q: float, confidence: float = 0.95) -> tuple[float, float]:
    """Return an interval for quantile ``q`` between two order statistics, valid for any distribution.

    The number of n values that lie below the true quantile is binomial (n, q).
    Source: Conover, Practical Nonparametric Statistics, section 3.2.

    Returns:
        Lower and upper bound, infinite on a side on which there are too few values.
    """
    ordered, n = np.sort(np.asarray(values, dtype=np.float64)), len(values)
    tail = 0.5 * (1.0 - confidence)
    lower, upper = int(binom.ppf(tail, n, q)), int(binom.ppf(1.0 - tail, n, q)) + 1
    return (
        float(ordered[lower - 1]) if lower >= 1 else -math.inf,
        float(ordered[upper - 1]) if upper <= n else math.inf,
    )
