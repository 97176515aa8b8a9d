"""The first state of the corner filter: pose and errors of calibration, fitted at once to one exposure.

With everything as designed, few or small tags can put the pose off by so much that its dependence on the
errors of calibration is another one there. So these are free in the fit, held by what is known of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from msrr_perception.kernels.corners import WeightedCorners, roots_of_covariance
from msrr_perception.kernels.rates import Rates
from msrr_perception.kernels.section_errors import DataSheet, variances_of_corners
from msrr_perception.motion.filter_state import CalibrationEstimate
from msrr_perception.pose.calibration import POSE_SIZE
from msrr_perception.pose.corner_fit import (
    CornerFit,
    are_in_one_plane,
    distinct,
    fit_corners,
    is_determined,
    measured_corners,
    pieces_along_yaw,
)
from msrr_perception.pose.joint_pose import CornerNoise, joint_fits, largest_tag, one_tag_poses
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.arrays import Array
from msrr_scenes.messages import TagDetection

#: Returns how the unit moves about the exposure if a state, shape (n,), is the right one at its stamp.
RatesAt = Callable[[Array], Rates]

#: Largest number of linearisations, in which errors of calibration move as well.
_ITERATIONS = 30


@dataclass(frozen=True, slots=True, eq=False)
class StartingState:
    """A first state, shapes (n,) and (n, n), and minus twice the logarithm of its likelihood."""

    mean: Array
    covariance: Array
    cost: float = 0.0


class _Found(NamedTuple):
    """First states, best first, and whether the best one explains the tags."""

    states: list[StartingState]
    agrees: bool


class FirstFit:
    """Fits first states."""

    def __init__(self, target: TargetModel, sheet: DataSheet, noise: CornerNoise, inflation: float) -> None:
        """Set up for a target.

        ``noise`` is the tilt of the floor, and the errors of corners by which tags are said to agree. The
        variances of corners are multiplied by ``inflation``: those of one exposure are alike.
        """
        self._target, self._layout = target, target.filter_layout
        self._sheet, self._noise, self._inflation = sheet, noise, inflation

    def states(
        self, tags: Sequence[TagDetection], known: CalibrationEstimate, rates_at: RatesAt
    ) -> list[StartingState]:
        """Return first states, best first, by the tags of the target in one exposure and by what is known.

        Of a unit that moves, the tags were exposed elsewhere than it is at the stamp, by the error of the
        camera's clock and by the rows of its shutter.
        There are none if the tags determine none, or do not agree: of three tags or more the one that
        disagrees is left out; of two that disagree neither can be trusted. There are more than one where the
        tags allow more than one pose, as a single flat tag does.
        """
        found = self._fit(tags, known, rates_at)
        if found is not None and not found.agrees:
            rests = [[t for t in tags if t is not odd] for odd in tags] if len(tags) > 2 else []
            fitted = [
                fit for rest in rests if (fit := self._fit(rest, known, rates_at)) is not None and fit.agrees
            ]
            found = min(fitted, key=lambda fit: fit.states[0].cost, default=None)
        return [] if found is None else found.states

    def _fit(
        self, tags: Sequence[TagDetection], known: CalibrationEstimate, rates_at: RatesAt
    ) -> _Found | None:
        """Return what a fit to some tags found; None if they determine nothing."""
        joint = joint_fits(self._target, tags, self._noise)
        if not joint:
            return None
        target, layout, n = self._target, self._layout, POSE_SIZE + len(known.mean)
        prior, information = np.concatenate([np.zeros(POSE_SIZE), known.mean]), np.zeros((n, n))
        information[range(3, POSE_SIZE), range(3, POSE_SIZE)] = self._noise.tilt_sigma**-2
        information[POSE_SIZE:, POSE_SIZE:] = np.linalg.inv(known.covariance)
        starts = [joint[0].state]
        starts += [pose_vector(X_DU) for X_DU in one_tag_poses(target, largest_tag(tags))]
        states = [np.concatenate([start, known.mean]) for start in starts]
        rates = rates_at(states[0])
        seen = self._seen(tags, states[0], rates)

        def fit(corners: WeightedCorners, start: Array) -> CornerFit | None:
            try:
                found = fit_corners(target, layout, corners, start, prior, information, _ITERATIONS)
            except np.linalg.LinAlgError:  # there is no solution near this start; there may be one elsewhere
                return None
            return found if is_determined(found) else None

        fits = [one for state in states if (one := fit(seen, state)) is not None]
        if not fits:
            return None
        found = distinct(fits)
        best = found[0].state
        if are_in_one_plane(target, tags):
            found = pieces_along_yaw(target, layout, seen, found, prior, information)
        # Tilt, motion and what surrounds a tag put corners off by more than they are weighed by.
        agreed = fit(self._seen(tags, best, rates, self._noise.corner_sigma_px), best)
        agrees = agreed is not None and _is_good(agreed.cost, len(tags))
        return _Found([StartingState(one.state, one.covariance, one.cost) for one in found], agrees)

    def _seen(
        self, tags: Sequence[TagDetection], state: Array, rates: Rates, more_px: float = 0.0
    ) -> WeightedCorners:
        """Return measured corners with their covariances, and with another independent deviation [px]."""
        measured = measured_corners(self._target, tags)
        variances = variances_of_corners(measured.corners, measured.sigma_px, self._sheet, self._inflation)
        variances = variances._replace(rest=variances.rest + more_px**2)
        target = self._target
        roots = roots_of_covariance(
            target.optics, self._layout.tags, measured, rates, state, variances, target.frame_period_s
        )
        return WeightedCorners(
            measured.which, measured.corners, measured.after, variances.border, roots, rates
        )


def _is_good(cost: float, tags: int) -> bool:
    """Return whether the cost of a fit to all corners of some tags, and to what is known, shows agreement."""
    # The bound is above twice the degrees of freedom because rendered corners are not quite independent.
    return cost <= 2.0 * (8 * tags - 3) + 12.0
