"""Quantiles of the chi-squared distribution, the thresholds of squared Mahalanobis distances."""

from __future__ import annotations

import math


def chi_squared_quantile(probability: float, degrees_of_freedom: int) -> float:
    """Return the value that a chi-squared variable falls below with this probability, which is less than 1.

    It is found by bisection. To import SciPy's quantiles takes longer than to import all of this package.
    """
    low, high = 0.0, 1.0
    while _survival(high, degrees_of_freedom) > 1.0 - probability:
        low, high = high, 2.0 * high
    while low < (middle := 0.5 * (low + high)) < high:
        if _survival(middle, degrees_of_freedom) > 1.0 - probability:
            low = middle
        else:
            high = middle
    return high


def _survival(value: float, degrees_of_freedom: int) -> float:
    """Return the probability that a chi-squared variable exceeds ``value``.

    It is that of one or two degrees of freedom, and a term for every two more (Abramowitz and Stegun, 26.4.4
    and 26.4.5).
    """
    half = 0.5 * value
    odd = degrees_of_freedom % 2
    survival = math.erfc(math.sqrt(half)) if odd else math.exp(-half)
    for k in range(3 if odd else 4, degrees_of_freedom + 1, 2):
        survival += half ** (0.5 * k - 1.0) * math.exp(-half) / math.gamma(0.5 * k)
    return survival
