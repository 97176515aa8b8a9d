"""Several states of a filter, of which one is right: a single flat tag allows two poses.

A Kalman filter that is started at one of them settles there, right or wrong, as its linearisation shows none
but this one. So every state that may be right is followed, until the measurements have decided: the Gaussian
sum filter (Alspach and Sorenson, "Nonlinear Bayesian estimation using Gaussian sum approximations", IEEE TAC
17, 1972), whose weights are kept as costs: minus twice the logarithm of the likelihood of all measurements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from msrr_perception.motion.filter_state import FilterState
from msrr_perception.pose.corner_fit import deviation, is_same_pose, odds
from msrr_scenes.arrays import frozen
from msrr_scenes.messages import PoseEstimate

#: Cost above that of the best state from which a state is given up: odds of one to 8,000. A state that is
#: half a turn off adds less than 2 deg to the standard deviation of the yaw when it is given up.
_GIVEN_UP = 18.0


def likeliest(states: Sequence[FilterState]) -> FilterState:
    """Return the best of one state or more, with the others that may be the right one as its alternatives.

    All of them have seen the same corners, so that these are as noisy by one as by the other. What became of
    the exposures is told by the best one: whichever leads from there on goes on counting from that.
    """
    best, *others = sorted(states, key=lambda state: state.cost)
    apart = [best]
    for other in others:
        same = (is_same_pose(other.mean, one.mean, one.covariance) for one in apart)
        if other.cost - best.cost < _GIVEN_UP and not any(same):
            apart.append(other)
    scale, seen = best.noise_scale, best.exposures
    alternatives = [
        r._replace(cost=r.cost - best.cost, noise_scale=scale, exposures=seen, alternatives=())
        for r in apart[1:]
    ]
    wheels_until_ns = max(one.wheels_until_ns for one in apart)
    return best._replace(cost=0.0, wheels_until_ns=wheels_until_ns, alternatives=tuple(alternatives))


def mixed(poses: Sequence[PoseEstimate], costs: Sequence[float]) -> PoseEstimate:
    """Return the first of some estimates with a covariance that holds all of them, each by its odds."""
    best = poses[0]
    covariance = np.zeros((3, 3))
    for pose, share in zip(poses, odds(costs).tolist(), strict=True):
        off = deviation(pose.X_DU.as_array(), best.X_DU.as_array())
        covariance += share * (pose.covariance + np.outer(off, off))
    return replace(best, covariance=frozen(covariance))
