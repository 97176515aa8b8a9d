"""The measurements of the corner filter: how tag corners and poses start and correct its state.

Every error of calibration that has a tolerance is in the state, so that it correlates what it has put off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from msrr_perception.estimation.chi_squared import chi_squared_quantile
from msrr_perception.estimation.motion import FilterState
from msrr_perception.kernels.calibrated import AT_REST, EDGE, Rates
from msrr_perception.kernels.corners import Seen, derivatives, roots_of_covariance
from msrr_perception.kernels.section_errors import CornerVariances, DataSheet
from msrr_perception.kernels.update import Rules, update
from msrr_perception.pose.corner_fit import equally_good, fit_corners
from msrr_perception.pose.joint_pose import (
    DEFAULT_CORNER_NOISE,
    CornerNoise,
    JointPose,
    consistent_pose,
    good_fit,
)
from msrr_perception.pose.target import YAW, TargetModel, pose_vector
from msrr_scenes.arrays import Array
from msrr_scenes.messages import PoseMeasurement, TagDetection

#: Share of an exposure in the variance of the corners by their residuals, and the largest such variance.
_NOISE_SHARE, _LARGEST_SCALE = 0.1, 100.0

#: Largest number of linearisations in an update, and the step at which it ends, in standard deviations.
_ITERATIONS, _TOLERANCE = 6, 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class StartingPose:
    """A measured pose with tilt that determines a state.

    Attributes:
        mean: ``(x, y, yaw, pitch, roll)``, shape (5,) [m, rad].
        covariance: Covariance of the mean by everything but the errors of calibration, shape (5, 5).
        by_errors: What each error of calibration adds to the true pose where this one was measured, shape
            (5, k).
    """

    mean: Array
    covariance: Array
    by_errors: Array


class CornerUpdate:
    """Starts and corrects a state by the measurements of one exposure."""

    def __init__(
        self,
        target: TargetModel,
        noise: CornerNoise,
        corner_sigma_px: float | None,
        gate_probability: float,
        start_inflation: float,
    ) -> None:
        """Set up for a target.

        Args:
            target: Camera, map of the tags, and tolerances.
            noise: Errors of corners and floor from which a first pose is computed.
            corner_sigma_px: Standard deviation of each corner coordinate [px]; None goes by the data sheet of
                the camera and the size of the tag in the image.
            gate_probability: Share of good tags that pass the gate.
            start_inflation: Factor on the first pose's covariance.
        """
        self._target, self._layout = target, target.filter_layout
        errors = target.corner_errors
        self._sheet = DataSheet(errors.noise_grey, errors.blur_px, errors.contrast, corner_sigma_px or 0.0)
        self._noise = noise
        self._shown = self._layout.size if self._layout.marker is None else self._layout.marker
        edges = self._layout.tags.columns[:, EDGE] - self._layout.first
        self._no_pixels = sorted({int(column) for column in edges if column >= 0})
        self._gate_probability = gate_probability
        self._inflation = start_inflation

    def start(self, measurement: PoseMeasurement | Sequence[TagDetection]) -> StartingPose | None:
        """Return a pose from one measurement alone; None when it does not determine one."""
        tilt = self._noise.tilt_sigma**2
        if isinstance(measurement, PoseMeasurement):
            P = np.diag([0.0, 0.0, 0.0, tilt, tilt])
            P[:3, :3] = self._inflation * measurement.covariance
            mean = pose_vector(measurement.X_DU)
            return StartingPose(mean, P, self._of_pose(self._at(mean)))
        pose = consistent_pose(self._target, measurement, self._noise, self._agree)
        if pose is None:
            return None
        mean = pose_vector(pose.X_DU, pose.pitch, pose.roll)
        P = pose.tilt_covariance.copy()
        P[:3, :3] += pose.covariance - pose.tilt_covariance[:3, :3]
        P[:3, :3] *= self._inflation
        used = [t for t in measurement if t.tag_id in pose.tags]
        seen = equally_good(self._layout, used, self._noise.corner_sigma_px)
        return StartingPose(mean, P, self._by_errors(self._at(mean), seen, self._noise.tilt_sigma))

    def by_pose(self, prior: FilterState, measurement: PoseMeasurement) -> FilterState | None:
        """Return the state corrected by a measured pose; None if that lies outside the gate."""
        P, n = prior.covariance, prior.mean.shape[0]
        # A measured pose is off by the errors of calibration as a pose from all tags would be.
        H = np.eye(3, n)
        by_errors = self._of_pose(prior.mean)[:3]
        H[:, self._layout.first : self._layout.first + by_errors.shape[1]] = -by_errors
        innovation = measurement.X_DU.as_array() - H @ prior.mean
        innovation[2] = math.remainder(innovation[2], 2.0 * math.pi)
        S = H @ P @ H.T + measurement.covariance
        gate = chi_squared_quantile(self._gate_probability, 3)
        if float(innovation @ np.linalg.solve(S, innovation)) > gate:
            return None
        gain = np.linalg.solve(S, H @ P).T
        mean = prior.mean + gain @ innovation
        mean[2] = math.remainder(mean[2], 2.0 * math.pi)
        left = np.eye(n) - gain @ H
        # Joseph's form keeps the covariance positive definite whatever the gain's rounding.
        covariance = left @ P @ left.T + gain @ measurement.covariance @ gain.T
        return replace(prior, mean=mean, covariance=covariance, last_seen_ns=prior.stamp_ns, rejected=0)

    def by_corners(
        self, prior: FilterState, tags: Sequence[TagDetection], rates: Rates
    ) -> FilterState | None:
        """Return the state corrected by the corners of those tags that pass the gate; None if none does.

        Args:
            prior: State at the exposure.
            tags: Tags of the target.
            rates: How the unit moves about the exposure.
        """
        which, corners, sigma_px = self._measured(tags)
        target, layout, scale = self._target, self._layout, prior.noise_scale
        mean, covariance, chi2, seen, fell = update(
            target.optics,
            layout.tags,
            which,
            corners,
            sigma_px,
            rates,
            self._sheet,
            scale,
            target.frame_period_s,
            prior.mean,
            prior.covariance,
            Rules(chi_squared_quantile(self._gate_probability, 8), _ITERATIONS, _TOLERANCE),
        )
        if not len(seen.which):
            return None
        if not fell:
            information = np.linalg.inv(prior.covariance)
            information = 0.5 * (information + information.T)
            fit = fit_corners(target, layout, seen, prior.mean, prior.mean, information, _ITERATIONS)
            mean, covariance, chi2 = fit.state, fit.covariance, fit.chi2
        mean[YAW] = math.remainder(mean[YAW], 2.0 * math.pi)
        found = scale * chi2 / seen.corners.size
        scale = (1.0 - _NOISE_SHARE) * scale + _NOISE_SHARE * found
        return replace(
            prior,
            mean=mean,
            covariance=covariance,
            last_seen_ns=prior.stamp_ns,
            rejected=0,
            noise_scale=min(max(scale, 1.0), _LARGEST_SCALE),
        )

    def _measured(self, tags: Sequence[TagDetection]) -> tuple[NDArray[np.int64], Array, Array]:
        """Return index, corners and their measured deviations of K tags, shapes (K,), (K, 8) and (K, 4)."""
        which = np.array([self._layout.index[t.tag_id] for t in tags], dtype=np.int64)
        corners = np.array([t.corners for t in tags], dtype=np.float64).reshape(-1, 8)
        not_measured = np.zeros(4)
        sigmas = [not_measured if t.corner_sigma_px is None else t.corner_sigma_px for t in tags]
        return which, corners, np.array(sigmas, dtype=np.float64)

    def _roots(
        self, which: NDArray[np.int64], corners: Array, state: Array, variances: CornerVariances
    ) -> Array:
        """Return the lower triangles of the covariances of corners, shape (K, 8, 8) [px]."""
        target = self._target
        return roots_of_covariance(
            target.optics,
            self._layout.tags,
            which,
            corners,
            AT_REST,
            state,
            variances,
            target.frame_period_s,
        )

    def _at(self, pose: Array) -> Array:
        """Return a state at a pose with tilt, shape (5,), with everything as drawn."""
        state = np.zeros(self._layout.size)
        state[:5] = pose
        return state

    def _of_pose(self, state: Array) -> Array:
        """Return what each error of calibration adds to the true pose where one is measured, shape (5, k).

        A pose is measured as :func:`joint_pose` computes it from the tags of the port, by the noise that it
        assumes and not by that of this filter, but without errors of the edges in an image. The tilt is not
        measured with it.
        """
        noise = DEFAULT_CORNER_NOISE
        which = np.array([self._layout.index[i] for i in self._target.port_tags], dtype=np.int64)
        roots = np.tile(noise.corner_sigma_px * np.eye(8), (len(which), 1, 1))
        seen = Seen(which, np.zeros((len(which), 8)), roots, AT_REST)
        by_errors = self._by_errors(state, seen, noise.tilt_sigma)
        by_errors[:, self._no_pixels] = 0.0
        by_errors[3:] = 0.0
        return by_errors

    def _by_errors(self, state: Array, seen: Seen, tilt_sigma: float) -> Array:
        """Return what each error of calibration adds to the true pose where one is fitted, shape (5, k).

        Args:
            state: State, shape (n,).
            seen: Corners, with the variances by which the fit weighs them.
            tilt_sigma: Standard deviation of pitch and roll in the fit [rad].
        """
        first = self._layout.first
        if self._shown == first:
            return np.zeros((5, 0))
        _, J = derivatives(self._target.optics, self._layout.tags, seen, state)
        information = J[:, :5].T @ J[:, :5]
        # The tilt is hardly determined by corners; its prior bounds what errors can make of it.
        information[range(3, 5), range(3, 5)] += tilt_sigma**-2
        return np.asarray(-np.linalg.solve(information, J[:, :5].T @ J[:, first : self._shown]))

    def _agree(self, pose: JointPose, tags: Sequence[TagDetection]) -> bool:
        """Return whether the tags of a pose agree, for all that calibration may have moved them."""
        if not len(self._layout.prior):
            return good_fit(pose.chi2, len(pose.tags))
        used = equally_good(self._layout, tags, self._noise.corner_sigma_px)
        state = self._at(pose_vector(pose.X_DU, pose.pitch, pose.roll))
        variances = _equal(len(tags), self._noise.corner_sigma_px**2)
        roots = self._roots(used.which, used.corners, state, variances)
        r, J = derivatives(self._target.optics, self._layout.tags, used._replace(roots=roots), state)
        J = J[:, self._layout.first :] * self._layout.prior
        return good_fit(float(r @ np.linalg.solve(np.eye(len(r)) + J @ J.T, r)), len(tags))


def _equal(count: int, variance: float) -> CornerVariances:
    """Return one variance [px^2] of each coordinate of all corners, which are independent."""
    none = np.zeros(count)
    return CornerVariances(none, none, np.full((count, 4), variance))
