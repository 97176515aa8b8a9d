"""Quantiles with their 95 % intervals, as the figures of the ablations show them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from msrr_bullet.statistics import quantile
from msrr_bullet.studies.model import Measured


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its 95 % interval.

    The upper bound is infinite where there are too few trials to bound the value. All three may be infinite
    where a timed event never happened in too many trials.
    """

    value: float
    low: float
    high: float


def estimate_quantile(measured: Measured, q: float) -> Estimate | None:
    """Return a quantile with its interval; None without values."""
    if not measured.values:
        return None
    return Estimate(quantile(measured.values, q), *quantile_interval(measured.values, q))


def quantile_interval(values: Sequence[float], q: float) -> tuple[float, float]:
    """Return a 95 % interval for quantile ``q`` between two order statistics, valid for any distribution.

    The number of n values that lie below the true quantile is binomial (n, q).
    Source: Conover, Practical Nonparametric Statistics, section 3.2.

    Returns:
        Lower and upper bound, infinite on a side on which there are too few values.
    """
    ordered, n = np.sort(np.asarray(values, dtype=np.float64)), len(values)
    lower, upper = int(binom.ppf(0.025, n, q)), int(binom.ppf(0.975, n, q)) + 1
    return (
        float(ordered[lower - 1]) if lower >= 1 else -math.inf,
        float(ordered[upper - 1]) if upper <= n else math.inf,
    )
