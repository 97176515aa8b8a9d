"""The change of errors at contact per unit of an effect."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal

import numpy as np
from scipy.special import gammaincinv, ndtri, stdtrit

from msrr_bullet.tolerance.model import Slope, StudyTrial
from msrr_scenes.arrays import Array

ContactQuantity = Literal["lateral_mm", "yaw_deg"]


def fit_slope(error: Array, change: Array, seed: Array, *, drawn: bool, chance: Slope | None = None) -> Slope:
    """Return the slope of signed changes over signed errors.

    Magnitudes of errors at contact cannot be subtracted from each other: +1 mm that becomes -1 mm is a change
    of 2 mm. Signed ones can, but an effect that pushes to the left in one trial and to the right in another
    has a least-squares slope of zero. The root mean square of the signed changes counts both, and its square
    adds up over independent effects; the least-squares slope says how much of it is the same in every trial.

    Args:
        error: Signed errors of the effect, shape (N,), none of them zero; standard deviations if ``drawn``.
        change: Signed error at contact minus that of the same trial without the effect, shape (N,).
        seed: Seed of the trial, shape (N,); docks of one trial need not be independent of each other.
        drawn: Whether the errors are not known but only their standard deviation.
        chance: Changes by an error that is too small to matter, from :func:`chance_of`. Their square is taken
            from that of the slope, the most that they may be from the lower bound of its interval, and the
            least from the upper one.
    """
    rms = float(np.sqrt((change**2).sum() / (error**2).sum()))
    mean = float((error * change).sum() / (error**2).sum())
    low, high = _interval(error, change, seed, rms, mean)
    if chance is not None:
        size = float(np.mean(error**2))
        pairs = (rms, chance.rms), (low, chance.high), (high, chance.low)
        rms, low, high = (math.sqrt(max(all_of**2 - by**2 / size, 0.0)) for all_of, by in pairs)
        high = max(high, abs(mean))  # the same in every trial is little by chance
    return Slope(rms=rms, low=low, high=high, systematic=None if drawn else mean, pairs=len(error))


def _interval(error: Array, change: Array, seed: Array, rms: float, mean: float) -> tuple[float, float]:
    """Return a 95 % interval of the root mean square, from the scatter of the squares between trials.

    The mean square counts as chi-square with the degrees of freedom that its variance has (Satterthwaite,
    An Approximate Distribution of Estimates of Variance Components, 1946). So few squares often scatter less
    than they should, so that their variance is at least that of normal changes about the same mean. The more
    the changes are alike, the more the interval is that of a mean, and the more it is widened to Student's t.
    Simulated, with 10, 20 and 30 trials it holds normal changes about any mean in 94 to 96 % of cases, such
    of Student's t with three degrees of freedom, whose squares have no finite variance, in 80, 76 and 75 %.
    """
    if rms == 0.0:
        return 0.0, 0.0
    of_trial = np.unique(seed, return_inverse=True)[1]
    squares, sizes = (np.bincount(of_trial, weights=values**2) for values in (change, error))
    n, constant = len(sizes), 0.0
    relative = squares / (rms**2 * sizes.sum()) - sizes / sizes.sum()
    variance = 0.0
    if n > 1:
        variance = n / (n - 1) * float((relative**2).sum())
        # The share of the mean in the mean square, less what chance makes of it.
        constant = max(0.0, (n * (mean / rms) ** 2 - 1.0) / (n - 1))
        student, normal = float(stdtrit(n - 1, 0.975)), float(ndtri(0.975))
        wider = (student / normal) ** 2
        variance *= 1.0 + (wider - 1.0) * constant**2
    variance = max(variance, 2.0 / n * (1.0 - constant**2), 1e-16)
    freedom = max(2.0 / variance, 1.0)  # one value has one, and several that scatter have no fewer
    chi_squared = (2.0 * float(gammaincinv(0.5 * freedom, p)) for p in (0.975, 0.025))  # its quantiles
    low, high = (rms * float(np.sqrt(freedom / quantile)) for quantile in chi_squared)
    return low, high


def contact_slope(
    with_effect: Iterable[StudyTrial],
    without: Iterable[StudyTrial],
    quantity: ContactQuantity,
    *,
    drawn: bool,
    chance: Slope | None = None,
) -> Slope | None:
    """Return the slope of an error at contact, over docks that came to contact with and without the effect.

    The trials have the same seeds, and ``drawn`` and ``chance`` are those of :func:`fit_slope`.
    """
    changes = _changes(with_effect, without, quantity)
    if not changes:
        return None
    errors = [trial.error for trial, _ in changes]
    seeds = [trial.seed for trial, _ in changes]
    change = np.array([change for _, change in changes])
    return fit_slope(np.array(errors, dtype=np.float64), change, np.array(seeds), drawn=drawn, chance=chance)


def chance_of(
    nearly: Iterable[StudyTrial], without: Iterable[StudyTrial], quantity: ContactQuantity
) -> Slope | None:
    """Return the changes of an error at contact by chance, per trial; None without a contact.

    ``nearly`` are trials with an error that is too small to matter, and the same seeds.
    """
    changes = _changes(nearly, without, quantity)
    if not changes:
        return None
    seeds, change = np.array([trial.seed for trial, _ in changes]), np.array([c for _, c in changes])
    return fit_slope(np.ones(len(changes)), change, seeds, drawn=True)


def _changes(
    trials: Iterable[StudyTrial], without: Iterable[StudyTrial], quantity: ContactQuantity
) -> list[tuple[StudyTrial, float]]:
    """Return the changes of an error at contact against trials with the same seeds, each with its trial."""
    before = {trial.seed: trial.contacts for trial in without}
    return [
        (trial, getattr(contact, quantity) - getattr(before[trial.seed][dock], quantity))
        for trial in trials
        for dock, contact in trial.contacts.items()
        if dock in before.get(trial.seed, {})
    ]
