"""Statistics of many trials: a rate with its confidence interval, and quantiles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from statistics import NormalDist

import numpy as np
from pydantic import BaseModel, ConfigDict

from msrr_scenes.arrays import Array


class Rate(BaseModel):
    """A rate with its Wilson interval; each value lies in 0 .. 1."""

    model_config = ConfigDict(frozen=True)

    rate: float
    low: float
    high: float


class Quantiles(BaseModel):
    """Median, 95th percentile and largest of some values; each is None when there are no values.

    A quantile may be infinite. JSON has no such number and gets the string ``Infinity``.
    """

    model_config = ConfigDict(frozen=True, ser_json_inf_nan="strings")

    p50: float | None
    p95: float | None
    max: float | None


def wilson(successes: int, trials: int, confidence: float = 0.95) -> Rate:
    """Return the success rate with Wilson's score interval.

    It keeps its level for rates near 0 and 1 and for few trials, where the usual normal interval collapses.
    Source: Wilson, Probable Inference, the Law of Succession, and Statistical Inference, JASA 22 (1927).

    Args:
        successes: Number of successful trials, at most ``trials``.
        trials: Number of trials. Without any the rate is unknown and returned as 0 with the interval 0 .. 1.
        confidence: Two-sided confidence level.

    Raises:
        ValueError: A count or the confidence level is out of range.
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
    """Return median, 95th percentile and largest of ``values``, some of which may be infinite."""
    array = np.fromiter(values, dtype=np.float64)
    if array.size == 0:
        return Quantiles(p50=None, p95=None, max=None)
    return Quantiles(p50=quantile(array, 0.5), p95=quantile(array, 0.95), max=float(array.max()))


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
