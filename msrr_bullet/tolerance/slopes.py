"""The change of errors at contact per unit of an effect."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np
from scipy.stats import bootstrap

from msrr_bullet.tolerance.model import Slope, StudyTrial
from msrr_scenes.arrays import Array

#: Resamples of the bootstrap; the same ones in every study.
_RESAMPLES = 2000


def fit_slope(error: Array, change: Array, *, drawn: bool) -> Slope:
    """Return the slope of signed changes over signed errors.

    Magnitudes of errors at contact cannot be subtracted from each other: +1 mm that becomes -1 mm is a change
    of 2 mm. Signed ones can, but an effect that pushes to the left in one trial and to the right in another
    has a least-squares slope of zero. The root mean square of the signed changes counts both, and its square
    adds up over independent effects; the least-squares slope says how much of it is the same in every trial.

    Args:
        error: Signed errors of the effect, shape (N,), none of them zero; standard deviations if ``drawn``.
        change: Signed error at contact minus that of the same trial without the effect, shape (N,).
        drawn: Whether the errors are not known but only their standard deviation.
    """

    def rms(x: Array, dy: Array, axis: int = -1) -> Array:
        return np.asarray(np.sqrt((dy**2).sum(axis) / (x**2).sum(axis)))

    value = float(rms(error, change))
    low = high = value
    if len(error) > 1:
        interval = bootstrap(
            (error, change),
            rms,
            paired=True,
            vectorized=True,
            n_resamples=_RESAMPLES,
            method="percentile",
            rng=np.random.default_rng(0),
        ).confidence_interval
        low, high = float(interval.low), float(interval.high)
    systematic = None if drawn else float((error * change).sum() / (error**2).sum())
    return Slope(rms=value, low=low, high=high, systematic=systematic, pairs=len(error))


def contact_slope(
    with_effect: Iterable[StudyTrial],
    without: Iterable[StudyTrial],
    quantity: Literal["lateral_mm", "yaw_deg"],
    *,
    drawn: bool,
) -> Slope | None:
    """Return the slope of an error at contact, over docks that came to contact with and without the effect.

    Args:
        with_effect: Trials with the effect.
        without: Trials with the same seeds and without any effect.
        quantity: Error at contact.
        drawn: Whether the errors of the trials are standard deviations.
    """
    before = {trial.seed: trial.contacts for trial in without}
    pairs = [
        (trial.error, getattr(contact, quantity) - getattr(before[trial.seed][dock], quantity))
        for trial in with_effect
        for dock, contact in trial.contacts.items()
        if dock in before.get(trial.seed, {})
    ]
    if not pairs:
        return None
    error, change = np.array(pairs, dtype=np.float64).T
    return fit_slope(error, change, drawn=drawn)
