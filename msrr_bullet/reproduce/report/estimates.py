"""Quantiles with their 95 % intervals, as the figures of the ablations show them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_bullet.statistics import quantile, quantile_interval
from msrr_bullet.studies.model import Measured


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its 95 % interval.

    A bound is infinite where there are too few trials to bound the value. All three may be infinite where a
    timed event never happened in too many trials.
    """

    value: float
    low: float
    high: float


def estimate_quantile(measured: Measured, q: float) -> Estimate | None:
    """Return a quantile with its interval; None without values."""
    if not measured.values:
        return None
    low, high = quantile_interval(measured.values, q)
    return Estimate(
        quantile(measured.values, q), -math.inf if low is None else low, math.inf if high is None else high
    )
