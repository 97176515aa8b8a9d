"""Quantiles of the chi-squared distribution, the thresholds of squared Mahalanobis distances."""

from __future__ import annotations

from functools import cache


@cache
def chi_squared_quantile(probability: float, degrees_of_freedom: int) -> float:
    """Return the value that a chi-squared variable falls below with this probability.

    It equals ``scipy.stats.chi2.ppf``, bit for bit, whose import would take as long as that of all of this
    package. That of this function still takes a tenth of a second, so gates are computed when they are used.
    """
    from scipy.special import gammaincinv

    return 2.0 * float(gammaincinv(0.5 * degrees_of_freedom, probability))
