"""The step of the corner filter from the state before a measurement to the state after it."""

from __future__ import annotations

import numpy as np

from msrr_perception.estimation.corner_update import CornerUpdate
from msrr_perception.estimation.hypotheses import likeliest
from msrr_perception.estimation.measurement_history import Measurement
from msrr_perception.estimation.wheel_doubt import doubts_wheels
from msrr_perception.kernels.rates import AT_REST, Rates
from msrr_perception.motion.drive_motion import DriveMotion
from msrr_perception.motion.filter_state import CalibrationEstimate, FilterState
from msrr_perception.motion.wheel_history import WheelHistory
from msrr_perception.pose.calibration import POSE_SIZE
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Detections, ExposureCounts

#: Standard deviation of the position above which it counts as unknown [m], as after wheel readings in degrees
#: instead of radians. At a thousand times that, rounding leaves nothing of the covariance of a pose that an
#: image shows.
_UNDETERMINED_M = 10.0

_FIRST_EXPOSURE = ExposureCounts(used=1)


class FilterStep:
    """Starts a filter, moves its state with the wheels to a measurement, and corrects it.

    Attributes:
        known: What is known of drive and calibration where the filter starts.
        pushed_ns: Times from and until which the target may be pushed, in order [ns].
    """

    def __init__(
        self, motion: DriveMotion, update: CornerUpdate, wheels: WheelHistory, reset_after: int
    ) -> None:
        """Set up without a state.

        The filter starts anew after ``reset_after`` measurements in a row outside the gate.
        """
        self._motion, self._update, self._wheels = motion, update, wheels
        self._reset_after = reset_after
        self.known: CalibrationEstimate = motion.prior
        self.pushed_ns: list[tuple[int, int]] = []

    def take(self, before: FilterState | None, measurement: Measurement) -> FilterState | None:
        """Return the state after a measurement; None before one has told where the unit is."""
        if before is None:
            return self._start(measurement)
        states = [self._updated(state, measurement) for state in (before, *before.alternatives)]
        current = [s for s in states if s.rejected < self._reset_after and not _is_undetermined(s)]
        if not current:
            start = self._start(measurement, states[0].wheels_until_ns, states[0].exposures)
            if start is not None:
                return start
            current = states
        return likeliest(current) if before.alternatives else current[0]

    def _updated(self, before: FilterState, measurement: Measurement) -> FilterState:
        """Return the state after a measurement, which corrects it where it agrees."""
        told = self._motion.to_measurement(before, self._wheels, measurement.exposure.stamp_ns)
        # At a port wheels may spin. A unit that they were taken to move would also be exposed elsewhere, by
        # the error of the clock, and be drawn out by the shutter: all of that would be learned. So one that
        # stood stands until it is seen to move.
        prior = self._motion.standing(before, told) if before.stood else told
        if any(first < prior.stamp_ns and before.stamp_ns < last for first, last in self.pushed_ns):
            prior = self._motion.pushed(prior, before.stamp_ns)
        rates = AT_REST
        if isinstance(measurement, Detections) or self._motion.learns_clock:
            if not before.stood:
                rates = self._motion.rates(prior, self._wheels)
            prior = prior._replace(wheels_until_ns=self._motion.wheels_until(prior))
        undetermined = _is_undetermined(prior)
        after = agreeing = None if undetermined else self._update.correct(prior, measurement, rates)
        rejected = agreeing.rejected if agreeing is not None else prior.rejected + 1
        anew = undetermined or rejected >= self._reset_after
        if not anew and doubts_wheels(prior, measurement, rejected):
            after = self._update.correct(self._motion.doubting(prior), measurement, rates) or agreeing
        prior = prior._replace(stood=False)  # who is not seen again may move
        if after is None:
            exposures = prior.exposures + ExposureCounts(rejected=1)
            cost = prior.cost + self._update.cost_outside(measurement)
            return prior._replace(
                rejected=rejected, rejected_ns=prior.stamp_ns, exposures=exposures, cost=cost
            )
        if isinstance(measurement, Detections):  # a measured pose is off by more than a unit moves meanwhile
            after = self._motion.with_exposure(before, told, after, rates)
        if agreeing is not None:
            return after._replace(exposures=prior.exposures + ExposureCounts(used=1))
        exposures = prior.exposures + ExposureCounts(without_wheels=1)
        return after._replace(wheels_doubted_ns=prior.stamp_ns, exposures=exposures)

    def _start(
        self,
        measurement: Measurement,
        wheels_until_ns: int = 0,
        exposures: ExposureCounts = _FIRST_EXPOSURE,
    ) -> FilterState | None:
        """Return a state from one measurement and the wheels about it; None when it does not determine one.

        It rests on what the wheels did until ``wheels_until_ns``, and on ``exposures`` up to this one. What
        was learned earlier may hold no more, as after a knock: then the drawing has to do.
        """
        known = (self.known,) if self.known is self._motion.prior else (self.known, self._motion.prior)
        for calibration in known:
            states = self._first_states(measurement, calibration)
            if states:
                until_ns = max(wheels_until_ns, *(one.wheels_until_ns for one in states))
                return likeliest(
                    [one._replace(wheels_until_ns=until_ns, exposures=exposures) for one in states]
                )
        return None

    def _first_states(self, measurement: Measurement, known: CalibrationEstimate) -> list[FilterState]:
        """Return states from one measurement, the wheels about it and what is known of the calibration."""
        stamp = measurement.exposure.stamp_ns
        wheels = self._wheels.angles_at(stamp)
        moves = isinstance(measurement, Detections) or self._motion.learns_clock
        covariance = np.zeros((POSE_SIZE + len(known.mean),) * 2)
        covariance[POSE_SIZE:, POSE_SIZE:] = known.covariance

        def rates_at(mean: Array) -> Rates:
            state = FilterState(stamp, mean, covariance, wheels, stamp)
            return self._motion.rates(state, self._wheels) if moves else AT_REST

        states = [
            FilterState(stamp, one.mean, one.covariance, wheels, stamp, cost=one.cost)
            for one in self._update.start(measurement, known, rates_at)
        ]
        if not moves:
            return states
        return [one._replace(wheels_until_ns=self._motion.wheels_until(one)) for one in states]


def _is_undetermined(state: FilterState) -> bool:
    """Return whether the position is unknown by its covariance."""
    P = state.covariance
    return float(P[0, 0] + P[1, 1]) > _UNDETERMINED_M**2
