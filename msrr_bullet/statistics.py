"""Statistics of many trials: a rate with its confidence interval, and quantiles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from statistics import NormalDist

import numpy as np
from pydantic import BaseModel

from msrr_scenes.arrays import Array


class Rate(BaseModel, frozen=True):
    """A rate with its Wilson interval; each value lies in 0 .. 1."""

    rate: float
    low: float
    high: float


#: Two-sided level of every confidence interval.
CONFIDENCE = 0.95

#: Bounds of a confidence interval; None where the values do not bound it.
Interval = tuple[float | None, float | None]


class Quantiles(BaseModel, frozen=True, ser_json_inf_nan="strings"):
    """Median, 95th percentile and largest of some values; each is None when there are no values.

    A quantile may be infinite. JSON has no such number and gets the string ``Infinity``.

    Attributes:
        p50: Median of the values.
        p95: 95th percentile of the values.
        max: Largest value.
        p50_interval: 95 % confidence interval of the median, of independent values; see
            :func:`quantile_interval`.
        p95_interval: That of the 95th percentile; fewer than 72 values do not bound it above.
    """

    p50: float | None
    p95: float | None
    max: float | None
    p50_interval: Interval = (None, None)
    p95_interval: Interval = (None, None)


def interval_text(interval: Interval, digits: int = 2) -> str:
    """Return an interval as text; empty if it has no lower bound, or if both bounds are the same text."""
    low, high = (None if bound is None else f"{bound:z.{digits}f}" for bound in interval)
    if low is None or low == high:
        return ""
    return f"at least {low}" if high is None else f"{low} .. {high}"


def wilson(successes: int, trials: int) -> Rate:
    """Return the success rate with Wilson's score interval.

    It keeps its level for rates near 0 and 1 and for few trials, where the usual normal interval collapses.
    Source: Wilson, Probable Inference, the Law of Succession, and Statistical Inference, JASA 22 (1927).

    Without trials the rate is unknown and returned as 0 with the interval 0 .. 1.

    Raises:
        ValueError: A count is out of range.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"expected 0 <= successes <= trials, found {successes} of {trials}")
    if trials == 0:
        return Rate(rate=0.0, low=0.0, high=1.0)
    z = NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE)
    p, n = successes / trials, float(trials)
    centre = (p + z * z / (2.0 * n)) / (1.0 + z * z / n)
    half = z / (1.0 + z * z / n) * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
    # At 0 and 1 the bound is exact; rounding would leave it a hair inside.
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == trials else min(1.0, centre + half)
    return Rate(rate=p, low=low, high=high)


def quantiles(values: Iterable[float], *, independent: bool = False) -> Quantiles:
    """Return median, 95th percentile and largest of ``values``, some of which may be infinite.

    If they are ``independent`` of each other, as those of different trials are, and those of one trial or
    image are not, median and 95th percentile get their intervals.
    """
    array = np.fromiter(values, dtype=np.float64)
    if array.size == 0:
        return Quantiles(p50=None, p95=None, max=None)
    p50, p95 = quantile(array, 0.5), quantile(array, 0.95)
    found = Quantiles(p50=p50, p95=p95, max=float(array.max()))
    if not independent:
        return found
    intervals = {f"p{round(100 * q)}_interval": quantile_interval(array, q) for q in (0.5, 0.95)}
    return found.model_copy(update=intervals)


def quantile(values: Sequence[float] | Array, q: float) -> float:
    """Return quantile ``q`` of ``values``, interpolated linearly between order statistics.

    It is infinite if the upper one of the two order statistics is, where numpy's would be NaN. The quantile
    of finite values is numpy's to the bit.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    if np.isfinite(ordered).all():
        return float(np.quantile(ordered, q))
    position = q * (len(ordered) - 1)
    index = int(position)
    lower, upper = ordered[index], ordered[min(index + 1, len(ordered) - 1)]
    if lower == upper or position == index:
        return float(lower)
    return float(lower + (position - index) * (upper - lower))


def quantile_interval(values: Sequence[float] | Array, q: float) -> Interval:
    """Return a confidence interval of quantile ``q`` of the distribution that ``values`` are drawn from.

    Its bounds are two of the values, so that it holds for every distribution: the number of values below the
    quantile is binomial. Each bound is wrong with at most half of the odds that :data:`CONFIDENCE` leaves.
    Source: David and Nagaraja, Order Statistics, 3rd ed. (2003), section 7.1.

    Values, shape (n,), are independent and may be infinite; ``q`` lies in 0 .. 1 without the ends.

    Returns:
        The bounds; None for one that no value is, for there are too few.

    Raises:
        ValueError: The quantile is out of range.
    """
    from scipy.special import bdtr  # a program that only reads such figures does without

    if not 0.0 < q < 1.0:
        raise ValueError(f"expected q between 0 and 1, found {q}")
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    n = ordered.size
    miss = 0.5 * (1.0 - CONFIDENCE)
    # Odds that at most k of the values are below the quantile, for k = 0 .. n - 1. They never fall with k.
    at_most = bdtr(np.arange(n, dtype=np.float64), n, q)
    low = int(np.searchsorted(at_most, miss, side="right"))
    high = int(np.searchsorted(at_most, 1.0 - miss, side="left"))
    return float(ordered[low - 1]) if low > 0 else None, float(ordered[high]) if high < n else None
