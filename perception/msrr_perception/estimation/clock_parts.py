"""The update of a state by an exposure whose time is in such doubt that the unit moves otherwise within it.

A unit that stands at the likeliest time of an exposure and sets off within the doubt shows no derivative by
the clock there: whatever has moved would be put down to its pose, or to a gross error. So the doubt is cut
into parts in which it moves alike, each is updated for itself, and one state has the moments of them all: the
Gaussian sum filter (Alspach and Sorenson, "Nonlinear Bayesian estimation using Gaussian sum approximations",
IEEE TAC 17, 1972).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from msrr_perception.kernels.rates import Rates
from msrr_perception.motion.filter_state import FilterState
from msrr_perception.pose.corner_fit import deviation, odds

#: Largest standard deviation of the clock in a part [s].
_PART_S = 0.01

#: Parts lie this many standard deviations to both sides of the mean, as far apart as each is wide.
_SIGMAS = 2.5

#: Way and turn by which another motion does not matter [m, rad]: a tenth of a pixel.
_ALIKE = 1e-4


def in_doubt(state: FilterState, clock: int, rates: Rates) -> bool:
    """Return whether a unit moves otherwise at some time of an exposure than at another one.

    ``clock`` is where the state has the time by which the clock of the camera is ahead.
    """
    sigma = math.sqrt(state.covariance[clock, clock])
    if sigma <= _PART_S:
        return False
    return bool(0.5 * _SIGMAS * sigma * np.ptp(rates.velocity, axis=0).max() > _ALIKE)


def by_parts(
    prior: FilterState, clock: int, correct: Callable[[FilterState], FilterState | None]
) -> FilterState | None:
    """Return a state corrected as the sum of its parts; None if each of them is outside the gate."""
    found = [one for part in _parts(prior, clock) if (one := correct(part)) is not None]
    if not found:
        return None
    costs = [one.cost for one in found]
    shares, best = odds(costs), min(found, key=lambda one: one.cost)
    off = np.array([deviation(one.mean, best.mean) for one in found])
    mean = shares @ off
    off -= mean
    covariance = np.tensordot(shares, [one.covariance for one in found], axes=1) + (shares * off.T) @ off
    cost = min(costs) - 2.0 * math.log(float(np.exp(-0.5 * (np.array(costs) - min(costs))).sum()))
    scale = float(shares @ [one.noise_scale for one in found])
    return best._replace(mean=best.mean + mean, covariance=covariance, noise_scale=scale, cost=cost)


def _parts(prior: FilterState, clock: int) -> list[FilterState]:
    """Return states that together have the distribution of one, with their odds as costs."""
    variance = float(prior.covariance[clock, clock])
    count = math.ceil(math.sqrt(variance) / _PART_S)
    width = math.sqrt(variance) / count
    # One state less the clock, and by how much all its entries change with that.
    change = prior.covariance[:, clock] / variance
    covariance = prior.covariance - np.outer(change, change) * (variance - width**2)
    ends = math.ceil(_SIGMAS * count)
    off = width * np.arange(-ends, ends + 1)
    costs = off**2 / (variance - width**2)
    costs += 2.0 * math.log(float(np.exp(-0.5 * costs).sum()))
    return [
        prior._replace(mean=prior.mean + change * d, covariance=covariance, cost=prior.cost + cost)
        for d, cost in zip(off.tolist(), costs.tolist(), strict=True)
    ]
