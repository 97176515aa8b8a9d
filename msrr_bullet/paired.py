"""Comparisons of two ways of running the same trials: paired, so that what the trials share cancels out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from msrr_bullet.statistics import quantile
from msrr_scenes.arrays import Array
from msrr_scenes.random_streams import stream


class PairedCount(NamedTuple):
    """What two ways of running the same trials make of a yes or no.

    Attributes:
        first_alone: Number of trials with a yes under the first alone.
        second_alone: Number of trials with a yes under the second alone.
        p: Probability of a difference this large, on either side, if neither made one.
    """

    first_alone: int
    second_alone: int
    p: float


def mcnemar(first: ArrayLike, second: ArrayLike) -> PairedCount:
    """Compare two ways by a yes or no of the same trials: McNemar's exact test.

    Only the trials count in which they differ. If the way made no difference, either would have the yes in
    half of these: their number is binomial.
    Source: McNemar, Note on the Sampling Error of the Difference Between Correlated Proportions, 1947.

    Flags are those of the same trials, shape (trials,).
    """
    from scipy.stats import binomtest  # slow to import, and most sweeps compare nothing

    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    alone = int((a & ~b).sum()), int((b & ~a).sum())
    p = float(binomtest(alone[0], sum(alone)).pvalue) if sum(alone) else 1.0
    return PairedCount(*alone, p)


#: Least expected number of trials beyond a quantile whose difference gets an interval: with fewer, the
#: bootstrap tells equal samples apart in more than the 5 % of cases that its level says.
_LEAST_BEYOND = 2.0

#: Least number of trials with which a median gets one, for the same reason.
_LEAST = 9

#: How many trials are drawn at once: more take more memory, and no less time.
_DRAWN_AT_ONCE = 1_000_000


class Difference(NamedTuple):
    """A quantile of one sample minus that of another, with its 95 % interval.

    The interval is None if there are too few trials for it: fewer than 40 for a 95th or 5th percentile, fewer
    than 9 for a median.
    """

    value: float
    interval: tuple[float, float] | None

    @property
    def is_apart(self) -> bool:
        """Whether the two samples differ beyond chance: there is an interval, and it does not hold zero."""
        return self.interval is not None and not self.interval[0] <= 0.0 <= self.interval[1]


def paired_difference(first: Array, second: Array, q: float, resamples: int = 2000) -> Difference:
    """Return the difference of a quantile between two ways of running the same trials: a paired bootstrap.

    Trials are drawn with replacement, each with its values under both ways, and the 95 % interval is that of
    the differences found (the percentile method). The draws are the same in every call.
    Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapters 8 and 13.

    Values are those of the same trials, shape (trials,), and infinite ones count as larger than any other.
    The quantile ``q`` lies in 0 .. 1 without the ends.

    Raises:
        ValueError: There are no trials, or their numbers differ.
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if a.shape != b.shape or a.size == 0:
        raise ValueError(f"expected as many values as in the other sample, found {a.size} and {b.size}")
    whole = float(_minus(np.array(quantile(a, q)), np.array(quantile(b, q))))
    if a.size < max(_LEAST, _LEAST_BEYOND / min(q, 1.0 - q)):
        return Difference(whole, None)
    rng, rows, parts = stream(0, "paired bootstrap"), max(1, _DRAWN_AT_ONCE // a.size), []
    for begun in range(0, resamples, rows):
        drawn = rng.integers(a.size, size=(min(rows, resamples - begun), a.size))
        parts.append(_minus(_quantiles(a[drawn], q), _quantiles(b[drawn], q)))
    found = np.sort(np.concatenate(parts))
    low, high = (float(found[round(share * (resamples - 1))]) for share in (0.025, 0.975))
    return Difference(whole, (low, high))


def _quantiles(values: Array, q: float) -> Array:
    """Return :func:`msrr_bullet.statistics.quantile` of every row."""
    ordered = np.sort(values, axis=-1)
    position = q * (ordered.shape[-1] - 1)
    index = int(position)
    if position == index:  # nothing of the next one, which may be infinite
        return ordered[:, index]
    lower, upper = ordered[:, index], ordered[:, index + 1]
    between: Array = lower + (position - index) * _minus(upper, lower)
    return between


def _minus(a: Array, b: Array) -> Array:
    """Subtract; two infinite values do not differ."""
    with np.errstate(invalid="ignore"):
        difference: Array = np.where(a == b, 0.0, a - b)
    return difference
