"""The measurements of the corner filter: how tag corners and poses start and correct its state.

Every error of calibration that has a tolerance is in the state, so that it correlates what it has put off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from msrr_perception.estimation.chi_squared import chi_squared_quantile
from msrr_perception.estimation.clock_parts import by_parts, in_doubt
from msrr_perception.estimation.first_fit import FirstFit, RatesAt, StartingState
from msrr_perception.estimation.measurement_history import Measurement
from msrr_perception.kernels.calibrated import EDGE
from msrr_perception.kernels.corners import MeasuredCorners, WeightedCorners, derivatives
from msrr_perception.kernels.edges import TAG_MODULES
from msrr_perception.kernels.rates import AT_REST, Rates, moved
from msrr_perception.kernels.section_errors import DataSheet
from msrr_perception.kernels.update import Rules, scaled_prior, update
from msrr_perception.motion.filter_state import CalibrationEstimate, FilterState
from msrr_perception.pose.calibration import POSE_SIZE
from msrr_perception.pose.corner_fit import deviation, fit_corners, measured_corners
from msrr_perception.pose.joint_pose import DEFAULT_CORNER_NOISE, CornerNoise
from msrr_perception.pose.target import YAW, TargetModel, pose_vector
from msrr_scenes.arrays import Array
from msrr_scenes.messages import Detections, PoseMeasurement, TagDetection

#: Share of an exposure in the variance of the corners by their residuals, and the largest such variance.
_NOISE_SHARE, _LARGEST_SCALE = 0.1, 100.0

#: Largest number of linearisations in an update, and the step at which it ends, in standard deviations.
_ITERATIONS, _TOLERANCE = 6, 3e-3

#: Number of damped fits: by the prior as it is linear at its mean, and at the solution of the first.
_SCALINGS = 2

#: Time after an exposure of which nothing agreed in which one of which a part agrees does not clear it [ns].
_LATELY_NS = 1_000_000_000

#: Way of a tag in the image during an exposure, in modules of its code, from which on its edges are off; and
#: the standard deviation of its corners then [px]. On rendered tags of 16 to 20 px that is 0.15 px (RMS),
#: mostly outwards, up to 1.9 modules. It counts twice, as it is alike in all pictures of a turn.
_SMEAR_MODULES, _SMEARED_PX = 0.5, 0.3


class CornerUpdate:
    """Starts and corrects a state by the measurements of one exposure."""

    def __init__(
        self,
        target: TargetModel,
        corner_sigma_px: float | None,
        tilt_sigma: float,
        gate_probability: float,
        start_inflation: float,
    ) -> None:
        """Set up for a target.

        The tilt is in radians; all else is as for
        :class:`msrr_perception.estimation.corner_filter.CornerEkf`.
        """
        self._target, self._layout = target, target.filter_layout
        self._clock = self._layout.clock
        errors = target.corner_errors
        self._sheet = DataSheet(errors.noise_grey, errors.blur_px, errors.contrast, corner_sigma_px or 0.0)
        self._tilt_sigma = tilt_sigma
        self._shown = self._layout.size if self._layout.marker is None else self._layout.marker
        edges = self._layout.tags.columns[:, EDGE] - self._layout.first
        self._no_pixels = sorted({int(column) for column in edges if column >= 0})
        # The tags of the port, seen as joint_pose takes them to be.
        which = np.array([self._layout.index[i] for i in target.port_tags], dtype=np.int64)
        roots = np.tile(DEFAULT_CORNER_NOISE.corner_sigma_px * np.eye(8), (len(which), 1, 1))
        pixels, after, border = (np.zeros((len(which), *shape)) for shape in ((8,), (4,), ()))
        self._port = WeightedCorners(which, pixels, after, border, roots, AT_REST)
        self._gate_probability = gate_probability
        self._inflation = start_inflation
        noise = CornerNoise(corner_sigma_px or DEFAULT_CORNER_NOISE.corner_sigma_px, tilt_sigma)
        self._first = FirstFit(target, self._sheet, noise, start_inflation)

    def start(
        self, measurement: Measurement, known: CalibrationEstimate, rates_at: RatesAt
    ) -> list[StartingState]:
        """Return first states by one measurement and by what is known of drive and calibration, best first.

        There are more than one where it allows more than one pose, and none where it determines none.
        """
        if isinstance(measurement, PoseMeasurement):
            return [self._start_by_pose(measurement, known, rates_at)]
        return self._first.states(self._of_target(measurement), known, rates_at)

    def correct(self, prior: FilterState, measurement: Measurement, rates: Rates) -> FilterState | None:
        """Return a state corrected by a measurement at its time; None if that lies outside the gate."""
        by = self._by(measurement, rates)
        if self._clock is not None and in_doubt(prior, self._clock, rates):
            return by_parts(prior, self._clock, by)
        return by(prior)

    def _by(self, measurement: Measurement, rates: Rates) -> Callable[[FilterState], FilterState | None]:
        """Return what corrects a state by a measurement and is None where that lies outside the gate."""
        if isinstance(measurement, PoseMeasurement):
            return partial(self._by_pose, measurement=measurement, rates=rates)
        measured = measured_corners(self._target, self._of_target(measurement))
        return partial(self._by_corners, measured=self._smeared(measured, rates), rates=rates)

    def _of_target(self, detections: Detections) -> list[TagDetection]:
        return [t for t in detections.tags if t.tag_id in self._target.corners_D]

    def _start_by_pose(
        self, measurement: PoseMeasurement, known: CalibrationEstimate, rates_at: RatesAt
    ) -> StartingState:
        """Return a first state from a measured pose."""
        pose = pose_vector(measurement.X_DU)
        state = np.concatenate([pose, known.mean])
        rates = rates_at(state)
        pose[:3] -= self._since_exposure(state, rates)
        by_errors = self._of_pose(self._at(pose), rates)
        first, k = self._layout.first - POSE_SIZE, by_errors.shape[1]
        A = np.zeros((POSE_SIZE, len(known.mean)))
        A[:, first : first + k] = by_errors
        measured = np.zeros((POSE_SIZE, POSE_SIZE))
        measured[:3, :3] = self._inflation * measurement.covariance
        measured[3:, 3:] = self._tilt_sigma**2 * np.eye(2)
        AQ = A @ known.covariance
        covariance = np.block([[measured + AQ @ A.T, AQ], [AQ.T, known.covariance]])
        return StartingState(np.concatenate([pose + A @ known.mean, known.mean]), covariance)

    def _by_pose(self, prior: FilterState, measurement: PoseMeasurement, rates: Rates) -> FilterState | None:
        """Return the state corrected by a measured pose; None if that lies outside the gate."""
        P, n = prior.covariance, prior.mean.shape[0]
        # A measured pose is off by the errors of calibration as a pose from all tags would be.
        H = np.eye(3, n)
        by_errors = self._of_pose(prior.mean, rates)[:3]
        H[:, self._layout.first : self._layout.first + by_errors.shape[1]] = -by_errors
        since = self._since_exposure(prior.mean, rates)
        innovation = deviation(measurement.X_DU.as_array() - since, H @ prior.mean)
        S = H @ P @ H.T + measurement.covariance
        distance = float(innovation @ np.linalg.solve(S, innovation))
        if distance > self._gate(3):
            return None
        gain = np.linalg.solve(S, H @ P).T
        mean = prior.mean + gain @ innovation
        mean[YAW] = math.remainder(mean[YAW], 2.0 * math.pi)
        left = np.eye(n) - gain @ H
        # Joseph's form keeps the covariance positive definite whatever the gain's rounding.
        covariance = left @ P @ left.T + gain @ measurement.covariance @ gain.T
        cost = prior.cost + distance + _log_determinant(S)
        return prior._replace(
            mean=mean, covariance=covariance, last_seen_ns=prior.stamp_ns, rejected=0, cost=cost
        )

    def _since_exposure(self, state: Array, rates: Rates) -> Array:
        """Return how a unit has moved to its exposure, shape (3,), beyond what the error of the clock tells.

        A measured pose is that at the exposure, and its derivatives tell the way by the velocity then alone.
        """
        late = float(state[self._clock]) if self._clock is not None else 0.0
        way, velocity = np.empty(3), np.empty(3)
        moved(rates, -late, way, velocity)
        return way + late * velocity

    def _by_corners(self, prior: FilterState, measured: MeasuredCorners, rates: Rates) -> FilterState | None:
        """Return the state corrected by the corners of those tags that pass the gate; None if none does.

        It is None as well where no state explains the corners from such a prior.
        """
        target, layout, scale = self._target, self._layout, prior.noise_scale
        mean, covariance, chi2, cost, seen, fell = update(
            target.optics,
            layout.tags,
            measured,
            rates,
            self._sheet,
            scale,
            target.frame_period_s,
            prior.mean,
            prior.covariance,
            Rules(self._gate(8), _ITERATIONS, _TOLERANCE),
        )
        if not len(seen.which):
            return None
        if not fell:
            mean = prior.mean
            try:
                for _ in range(_SCALINGS):
                    base, spread = scaled_prior(layout.tags, prior.mean, prior.covariance, mean)
                    inverse = np.linalg.inv(spread)
                    information: Array = 0.5 * (inverse + inverse.T)
                    fit = fit_corners(target, layout, seen, mean, base, information, _ITERATIONS)
                    mean = fit.state
            except np.linalg.LinAlgError:  # by wheel readings in degrees the target is behind, or metres away
                return None
            covariance, chi2 = fit.covariance, fit.chi2
            cost = fit.cost - _log_determinant(information) - _log_determinant(covariance)
        mean[YAW] = math.remainder(mean[YAW], 2.0 * math.pi)
        # Near a port each exposure shows a tag or two, and a wrong pose may agree with one of them alone.
        left_out = len(measured.which) - len(seen.which)
        lately = prior.stamp_ns - prior.rejected_ns <= _LATELY_NS
        rejected = prior.rejected if left_out and lately else 0
        found = scale * chi2 / seen.corners.size
        scale = (1.0 - _NOISE_SHARE) * scale + _NOISE_SHARE * found
        return prior._replace(
            mean=mean,
            covariance=covariance,
            last_seen_ns=prior.stamp_ns,
            rejected=rejected,
            noise_scale=min(max(scale, 1.0), _LARGEST_SCALE),
            cost=prior.cost + cost + self._gate(8) * left_out,
        )

    def _smeared(self, measured: MeasuredCorners, rates: Rates) -> MeasuredCorners:
        """Return measured corners, less sure those of tags that a turn of the camera has smeared.

        Where light of the next module reaches the pixels at which an edge is measured, the edge moves, and in
        the same way for as long as the turn lasts.
        """
        target = self._target
        turn = abs(float(rates.velocity[len(rates.velocity) // 2, 2]))
        smear_px = target.exposure_s * target.camera.focal * turn
        if smear_px <= _SMEAR_MODULES:  # no tag can be read whose modules have less than a pixel
            return measured
        corners = measured.corners.reshape(-1, 4, 2)
        sides = corners - corners[:, (3, 0, 1, 2)]
        edges = np.sqrt(np.square(sides).sum(axis=2).max(axis=1))
        more = np.where(smear_px > _SMEAR_MODULES * edges / TAG_MODULES, _SMEARED_PX, 0.0)
        return measured._replace(sigma_px=np.hypot(measured.sigma_px, more[:, None]))

    def cost_outside(self, measurement: Measurement) -> float:
        """Return the cost of a measurement that lies outside the gate: at least that of its border."""
        if isinstance(measurement, PoseMeasurement):
            return self._gate(3)
        return self._gate(8) * len(self._of_target(measurement))

    def _gate(self, freedom: int) -> float:
        """Return the squared Mahalanobis distance beyond which a measurement of some freedom is left out."""
        return chi_squared_quantile(self._gate_probability, freedom)

    def _at(self, pose: Array) -> Array:
        """Return a state at a pose with tilt, shape (5,), with everything as designed."""
        state = np.zeros(self._layout.size)
        state[:5] = pose
        return state

    def _of_pose(self, state: Array, rates: Rates) -> Array:
        """Return what each error of calibration adds to the true pose where one is measured, shape (5, k).

        A pose is measured as :func:`joint_pose` computes it from the tags of the port, by the noise that it
        assumes and not by that of this filter, but without errors of the edges in an image. The tilt is not
        measured with it.
        """
        first = self._layout.first
        if self._layout.roof is not None:
            return _by_roof(float(state[YAW]))
        if self._shown == first:
            return np.zeros((POSE_SIZE, 0))
        port = self._port._replace(rates=rates)
        _, J = derivatives(self._target.optics, self._layout.tags, port, state)
        information = J[:, :5].T @ J[:, :5]
        # The tilt is hardly determined by corners; its prior bounds what errors can make of it.
        information[range(3, 5), range(3, 5)] += DEFAULT_CORNER_NOISE.tilt_sigma**-2
        by_errors = -np.linalg.solve(information, J[:, :5].T @ J[:, first : self._shown])
        by_errors[:, self._no_pixels] = 0.0
        by_errors[3:] = 0.0
        return np.asarray(by_errors)


def _by_roof(yaw: float) -> Array:
    """Return what the place of the tag on the roof adds to the true pose where one is measured, (5, 3)."""
    c, s = math.cos(yaw), math.sin(yaw)
    by_errors = np.zeros((POSE_SIZE, 3))
    by_errors[:3] = [[-c, s, 0.0], [-s, -c, 0.0], [0.0, 0.0, -1.0]]
    return by_errors


def _log_determinant(covariance: Array) -> float:
    return float(np.linalg.slogdet(covariance)[1])
