"""The corner filter: an iterated extended Kalman filter whose measurements are tag corners in pixels.

It never forms a pose from one picture (but at its start): each corner pulls at the state directly, so a view
that says little about one direction does no harm there. Between exposures the wheels move the state.
Measurements take effect at the time of their exposure, however late or in whatever order they arrive.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from msrr_perception.estimation.motion import DEFAULT_NOISE, STATE_SIZE, DriveMotion, FilterState, MotionNoise
from msrr_perception.estimation.wheel_history import WheelHistory
from msrr_perception.kernels.fit import gate_distances
from msrr_perception.pose.corner_fit import Corners, fit_corners
from msrr_perception.pose.joint_pose import DEFAULT_CORNER_NOISE, CornerNoise, consistent_pose, gather_corners
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    NS_PER_S,
    Detections,
    PoseEstimate,
    PoseMeasurement,
    TagDetection,
    WheelOdometry,
)
from msrr_scenes.specs.sensors import OdometrySpec

_Measurement = Detections | PoseMeasurement


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """A measurement and the belief right after it; ``before`` is the belief it found."""

    key: tuple[int, int, str]
    measurement: _Measurement
    after: FilterState | None


class CornerEkf:
    """An estimator of X_DU from tag corners and wheel odometry.

    The protocol that it fulfils is :class:`msrr_perception.estimation.estimator.Estimator`.

    Attributes:
        target: Camera, drive and map of the tags.
        delay_compensation: Whether :meth:`estimate` speaks of now or of the last exposure.
    """

    def __init__(
        self,
        target: TargetModel,
        odometry: OdometrySpec,
        delay_compensation: bool = True,
        corner_sigma_px: float = DEFAULT_CORNER_NOISE.corner_sigma_px,
        tilt_sigma_deg: float = 0.3,
        gate_probability: float = 0.9999,
        reset_after: int = 5,
        horizon_s: float = 1.0,
        start_inflation: float = 2.0,
        slip: float = DEFAULT_NOISE.slip,
        contact_zone_m: float = DEFAULT_NOISE.contact_zone,
    ) -> None:
        """Set up an estimator that knows nothing yet.

        Args:
            target: Camera, drive and map of the tags.
            odometry: Design values of the encoders.
            delay_compensation: Whether :meth:`estimate` moves the last exposure's pose up to now.
            corner_sigma_px: Of each corner coordinate.
            tilt_sigma_deg: Of pitch and roll of the pair.
            gate_probability: Share of good tags that pass the gate.
            reset_after: Exposures in a row with nothing inside the gate after which it starts anew.
            horizon_s: How late a measurement may be.
            start_inflation: Factor on the first pose's covariance.
            slip: See :class:`msrr_perception.estimation.motion.MotionNoise`.
            contact_zone_m: See there.

        Raises:
            SceneError: A parameter out of its range.
        """
        if (
            min(corner_sigma_px, tilt_sigma_deg, horizon_s, slip) <= 0.0
            or start_inflation < 1.0
            or reset_after < 1
        ):
            raise SceneError(
                "corner_ekf: corner_sigma_px, tilt_sigma_deg, horizon_s and slip must be positive, "
                "start_inflation and reset_after at least 1"
            )
        if not 0.5 < gate_probability < 1.0:
            raise SceneError(f"corner_ekf: gate_probability must lie in 0.5..1, not {gate_probability}")
        self.target = target
        self.delay_compensation = delay_compensation
        self._noise = CornerNoise(corner_sigma_px, math.radians(tilt_sigma_deg))
        self._motion = DriveMotion(
            target,
            odometry,
            MotionNoise(slip=slip, contact_zone=contact_zone_m, tilt_sigma=math.radians(tilt_sigma_deg)),
        )
        self._tag_gate = float(chi2.ppf(gate_probability, 8))
        self._pose_gate = float(chi2.ppf(gate_probability, 3))
        self._reset_after = reset_after
        self._horizon_ns = round(horizon_s * NS_PER_S)
        self._start_inflation = start_inflation
        self.reset()

    def reset(self) -> None:
        """Forget everything but the encoders' readings."""
        if not hasattr(self, "_wheels"):
            self._wheels = WheelHistory()
        self._told: dict[int, PoseEstimate | None] = {}
        self._entries: list[_Entry] = []
        self._head: tuple[FilterState, FilterState] | None = None

    def add_odometry(self, reading: WheelOdometry) -> None:
        """Take in an encoder reading."""
        self._told.clear()
        if not self._wheels.add(reading):
            self._head = None  # a reading from the past changes the way to the present

    def add_detections(self, detections: Detections) -> None:
        """Take in the tags of one exposure; tags of other units and empty frames change nothing."""
        if any(t.tag_id in self.target.corners_D for t in detections.tags):
            self._insert(detections)

    def add_pose(self, measurement: PoseMeasurement) -> None:
        """Take in a ready-made pose."""
        self._insert(measurement)

    def predict(self, stamp_ns: int) -> PoseEstimate | None:
        """Return the pose at an instant, past (within the horizon) or future, from all known by now."""
        if stamp_ns not in self._told:  # several ask for the same instant
            self._told[stamp_ns] = self._predict(stamp_ns)
        return self._told[stamp_ns]

    def _predict(self, stamp_ns: int) -> PoseEstimate | None:
        state = self._state_before(stamp_ns)
        if state is None:
            return None
        newest = self._entries[-1].after
        if state is newest:
            state = self._advance_head(state, stamp_ns)
        return _report(self._motion.propagate(state, self._wheels, stamp_ns))

    def estimate(self, now_ns: int) -> PoseEstimate | None:
        """Return what control gets: the pose now, or at the last exposure without delay compensation."""
        if self.delay_compensation:
            return self.predict(now_ns)
        state = self._state_before(now_ns)
        return None if state is None else _report(state)

    def _state_before(self, stamp_ns: int) -> FilterState | None:
        for entry in reversed(self._entries):
            if entry.key[0] <= stamp_ns:
                return entry.after
        return None

    def _advance_head(self, base: FilterState, stamp_ns: int) -> FilterState:
        """Return the belief at the newest reading before ``stamp_ns``, remembered to go no way twice."""
        reached = base
        if self._head is not None and self._head[0] is base and self._head[1].stamp_ns <= stamp_ns:
            reached = self._head[1]
        until = self._wheels.newest_until(stamp_ns)
        if until is not None and until > reached.stamp_ns:
            reached = self._motion.propagate(reached, self._wheels, until)
            self._head = (base, reached)
        return reached

    def _insert(self, measurement: _Measurement) -> None:
        """Put a measurement in its place in time and run again what comes after it."""
        self._told.clear()
        exposure = measurement.exposure
        key = (exposure.stamp_ns, exposure.frame, exposure.camera)
        i = bisect_left(self._entries, key, key=lambda e: e.key)
        if i < len(self._entries) and self._entries[i].key == key:
            return  # delivered twice
        if i == 0 and self._entries and key[0] < self._entries[-1].key[0] - self._horizon_ns:
            return  # too late to matter
        redo = [measurement, *(e.measurement for e in self._entries[i:])]
        del self._entries[i:]
        self._head = None
        for m in redo:
            before = self._entries[-1].after if self._entries else None
            after = self._process(before, m)
            self._entries.append(_Entry((m.exposure.stamp_ns, m.exposure.frame, m.exposure.camera), m, after))
        self._forget()

    def _forget(self) -> None:
        oldest = self._entries[-1].key[0] - self._horizon_ns
        keep = max(bisect_left(self._entries, oldest, key=lambda e: e.key[0]) - 1, 0)
        del self._entries[:keep]
        self._wheels.forget_before(min(self._entries[0].key[0], oldest))

    def _process(self, before: FilterState | None, measurement: _Measurement) -> FilterState | None:
        if before is None:
            return self._start(measurement)
        prior = self._motion.propagate(before, self._wheels, measurement.exposure.stamp_ns)
        if isinstance(measurement, PoseMeasurement):
            after = self._update_pose(prior, measurement)
        else:
            after = self._update_corners(prior, measurement.tags)
        if after is not None:
            return replace(after, last_seen_ns=measurement.exposure.stamp_ns, rejected=0)
        lost = replace(prior, rejected=prior.rejected + 1)
        return (self._start(measurement) or lost) if lost.rejected >= self._reset_after else lost

    def _start(self, measurement: _Measurement) -> FilterState | None:
        """Return a belief from one measurement alone; None when it does not allow one."""
        stamp = measurement.exposure.stamp_ns
        P = np.diag([0.0, 0.0, 0.0, self._noise.tilt_sigma**2, self._noise.tilt_sigma**2])
        if isinstance(measurement, PoseMeasurement):
            P[:3, :3] = measurement.covariance
            mean = np.append(measurement.X_DU.as_array(), [0.0, 0.0])
        else:
            pose = consistent_pose(self.target, measurement.tags, self._noise)
            if pose is None:
                return None
            mean = np.append(pose.X_DU.as_array(), [pose.pitch, pose.roll])
            P[:] = pose.tilt_covariance
            P[:3, :3] += pose.covariance - pose.tilt_covariance[:3, :3]
        P[:3, :3] *= self._start_inflation
        return self._motion.initial(stamp, mean, P, self._wheels.at(stamp))

    def _update_pose(self, prior: FilterState, measurement: PoseMeasurement) -> FilterState | None:
        P = prior.covariance
        innovation = measurement.X_DU.as_array() - prior.mean[:3]
        innovation[2] = math.remainder(innovation[2], 2.0 * math.pi)
        S = P[:3, :3] + measurement.covariance
        if float(innovation @ np.linalg.solve(S, innovation)) > self._pose_gate:
            return None
        gain = np.linalg.solve(S, P[:3]).T
        mean = prior.mean + gain @ innovation
        mean[2] = math.remainder(mean[2], 2.0 * math.pi)
        left = np.eye(STATE_SIZE)
        left[:, :3] -= gain
        # Joseph's form keeps the covariance positive definite whatever the gain's rounding.
        covariance = left @ P @ left.T + gain @ measurement.covariance @ gain.T
        return replace(prior, mean=mean, covariance=covariance)

    def _update_corners(self, prior: FilterState, tags: tuple[TagDetection, ...]) -> FilterState | None:
        known = [t for t in tags if t.tag_id in self.target.corners_D]
        every = gather_corners(self.target, known, self._noise.corner_sigma_px)
        inside = self._gate(prior, every)
        if not inside.any():
            return None
        rows = np.repeat(inside, 4)
        corners = Corners(every.points_D[rows], every.pixels[np.repeat(rows, 2)], every.sigma_px)
        information = np.linalg.inv(prior.covariance)
        fit = fit_corners(
            self.target,
            corners,
            prior.mean,
            prior.mean,
            0.5 * (information + information.T),
            max_iterations=6,
        )
        return replace(prior, mean=fit.state, covariance=fit.covariance)

    def _gate(self, prior: FilterState, corners: Corners) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Say of each tag, shape (tags,), whether its corners lie where the prediction allows them."""
        distance: Array = gate_distances(
            self.target.optics,
            corners.points_D,
            corners.pixels,
            corners.sigma_px,
            prior.mean,
            prior.covariance,
        )
        return distance <= self._tag_gate


def _report(state: FilterState) -> PoseEstimate:
    covariance = state.covariance[:3, :3].copy()
    return PoseEstimate(
        state.stamp_ns, SE2(*state.mean[:3]), 0.5 * (covariance + covariance.T), state.last_seen_ns
    )
