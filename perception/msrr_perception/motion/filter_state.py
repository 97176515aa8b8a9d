"""The state of the corner filter at one instant, and what is known of everything in it but the pose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from msrr_perception.motion.wheel_history import WheelAngles
from msrr_scenes.arrays import Array
from msrr_scenes.messages import ExposureCounts

_NO_EXPOSURES = ExposureCounts()


class FilterState(NamedTuple):
    """The state of the filter at one instant.

    Attributes:
        stamp_ns: Time of the state.
        mean: Mean, shape (n,): x, y, yaw of U in D, if the marker of the port is as designed [m, rad],
            pitch and roll of the pair [rad], relative errors of both radii and of the track, and the errors
            of calibration of the filter's layout.
        covariance: Covariance of the mean, shape (n, n).
        wheels: Encoder angles up to which motion is accounted for; None while no reading is known.
        last_seen_ns: Exposure time of the last measurement that passed the gate.
        rejected: Number of exposures of which nothing passed the gate since the last of which everything did,
            or since one of which a part did and that came a second after them or later.
        noise_scale: Variance of the corners, as their residuals show it, over that by the data sheet.
        wheels_until_ns: Time until which the last measurement rests on what the wheels did [ns].
        wheels_doubted_ns: Exposure time of the last measurement that agrees only if the wheel readings are
            doubted; None if all agree with them.
        exposures: What became of the exposures up to this state.
        cost: Minus twice the logarithm of the likelihood of its measurements; only the difference
            between alternatives has a meaning.
        alternatives: Other states that may be the right one instead; they have no alternatives themselves.
        stood: Whether the unit stood at a port at the last measurement, whatever its wheels told.
        exposed: Place (x, y) of the unit at the exposure of that, which was not at its stamp [m].
        rejected_ns: Time of the last exposure of which nothing passed the gate [ns].
    """

    stamp_ns: int
    mean: Array
    covariance: Array
    wheels: WheelAngles | None
    last_seen_ns: int
    rejected: int = 0
    noise_scale: float = 1.0
    wheels_until_ns: int = 0
    wheels_doubted_ns: int | None = None
    exposures: ExposureCounts = _NO_EXPOSURES
    cost: float = 0.0
    alternatives: tuple[FilterState, ...] = ()
    stood: bool = False
    exposed: tuple[float, float] = (math.nan, math.nan)
    rejected_ns: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationEstimate:
    """An estimate of everything in the state of a filter but the pose.

    Attributes:
        mean: Means, shape (m,): relative errors of wheel radii and track, then the errors of calibration.
        covariance: Their covariance, shape (m, m).
        shared: Indices of those that do not depend on the target: of the unit's own wheels and camera.
    """

    mean: Array
    covariance: Array
    shared: NDArray[np.int64]

    def of_another_target(self, prior: CalibrationEstimate) -> CalibrationEstimate:
        """Return what is left for a target of which only the drawing is known, which says ``prior``."""
        mean, covariance = prior.mean.copy(), prior.covariance.copy()
        mean[prior.shared] = self.mean[self.shared]
        covariance[np.ix_(prior.shared, prior.shared)] = self.covariance[np.ix_(self.shared, self.shared)]
        return CalibrationEstimate(mean, covariance, prior.shared)
