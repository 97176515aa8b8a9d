"""The corner filter: an iterated extended Kalman filter whose measurements are tag corners in pixels.

It forms a pose from one image only at its start: after that each corner corrects the state directly, so a
view that constrains one direction poorly does no harm there. Between exposures the wheels move the state, as
long as exposures agree with what they tell.
Measurements take effect at the time of their exposure, however late or in whatever order they arrive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from msrr_perception.estimation.calibration_errors import EstimatedCalibrationError, calibration_errors
from msrr_perception.estimation.corner_update import CornerUpdate
from msrr_perception.estimation.dock_frame import in_seat
from msrr_perception.estimation.filter_step import FilterStep
from msrr_perception.estimation.hypotheses import mixed
from msrr_perception.estimation.measurement_history import Measurement, MeasurementHistory
from msrr_perception.motion.drive_motion import DriveMotion
from msrr_perception.motion.filter_state import CalibrationEstimate, FilterState
from msrr_perception.motion.motion_noise import DEFAULT_NOISE, MotionNoise
from msrr_perception.motion.wheel_history import WheelHistory
from msrr_perception.pose.calibration import DRIVE_SIZE, POSE_SIZE
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.errors import ParameterError
from msrr_scenes.messages import (
    NS_PER_S,
    Detections,
    ExposureCounts,
    PoseEstimate,
    PoseMeasurement,
    WheelOdometry,
)
from msrr_scenes.registry import require_in_range
from msrr_scenes.specs.sensors import OdometrySpec

#: End of the errors of the drive in a state.
_DRIVE_END = POSE_SIZE + DRIVE_SIZE

#: Largest delay of a first measurement [ns]: latency and jitter of a camera, and the error of its clock.
_LATEST_NS = 4 * NS_PER_S

#: Ranges of the parameters. Ten pixels are most of a tag's cell, a unit that is tilted by 30 deg has fallen,
#: a gate that passes half of all good tags or all of any starves or believes anything, an older measurement
#: than ten seconds is of another approach, and slip of a metre on a metre is no drive.
_RANGES = {
    "corner_sigma_px": (0.001, 10.0),
    "tilt_sigma_deg": (0.001, 30.0),
    "gate_probability": (0.5, 0.999999),
    "reset_after": (1, 10_000),
    "horizon_s": (0.001, 10.0),
    "start_inflation": (1.0, 1e4),
    "slip": (1e-6, 1.0),
}


class CornerEkf:
    """An estimator of X_DU from tag corners and wheel odometry.

    It implements :class:`msrr_perception.estimation.estimator.Estimator`.

    Attributes:
        target: Camera, drive and map of the tags.
        delay_compensation: Whether :meth:`estimate` returns the pose of now or that of the last exposure.
    """

    def __init__(
        self,
        target: TargetModel,
        odometry: OdometrySpec,
        delay_compensation: bool = True,
        corner_sigma_px: float | None = None,
        tilt_sigma_deg: float = 0.05,
        gate_probability: float = 0.9999,
        reset_after: int = 5,
        horizon_s: float = 1.0,
        start_inflation: float = 2.0,
        slip: float = DEFAULT_NOISE.slip,
        motion: MotionNoise | None = None,
    ) -> None:
        """Create an estimator that knows nothing yet.

        Args:
            target: Camera, drive and map of the tags.
            odometry: Data sheet of the encoders.
            delay_compensation: Whether :meth:`estimate` moves the last exposure's pose up to now.
            corner_sigma_px: Standard deviation of each corner coordinate [px]; None goes by the data sheet of
                the camera and the size of a tag in the image.
            tilt_sigma_deg: Standard deviation of pitch and roll of the pair [deg].
            gate_probability: Share of good tags that pass the gate.
            reset_after: Number of exposures in a row with nothing inside the gate after which it starts anew.
            horizon_s: Largest delay of a measurement that still counts [s].
            start_inflation: Factor on the covariance of what a first state is computed from.
            slip: ``slip`` of :class:`msrr_perception.motion.motion_noise.MotionNoise`.
            motion: Random motion that the encoders do not measure, with a tilt of ``tilt_sigma_deg``; None
                takes that of a unit near a port with ``slip``.

        Raises:
            ParameterError: A parameter is out of its range.
        """
        require_in_range(_RANGES, locals(), optional=("corner_sigma_px",))
        if motion is not None and not isinstance(motion, MotionNoise):
            raise ParameterError({"motion": "it is for programs; a scene gives slip"})
        self.target = target
        self.delay_compensation = delay_compensation
        tilt_sigma = math.radians(tilt_sigma_deg)
        motion_noise = replace(motion or MotionNoise(slip=slip), tilt_sigma=tilt_sigma)
        self._motion = DriveMotion(target, odometry, motion_noise)
        self._horizon_ns = round(horizon_s * NS_PER_S)
        self._wheels = WheelHistory()
        update = CornerUpdate(target, corner_sigma_px, tilt_sigma, gate_probability, start_inflation)
        self._step = FilterStep(self._motion, update, self._wheels, reset_after)
        self.reset()

    def reset(self) -> None:
        """Forget everything but the encoder readings, pushes that are expected and what was recalled."""
        self._predictions: dict[int, PoseEstimate | None] = {}
        self._history = MeasurementHistory(self._step.take, self._horizon_ns)
        self._head: tuple[FilterState, FilterState] | None = None

    def add_odometry(self, reading: WheelOdometry) -> None:
        """Add an encoder reading; exposures that rest on what it tells are processed again."""
        before_ns = self._wheels.newest_stamp(reading.stamp_ns)
        if before_ns == reading.stamp_ns:
            return  # delivered twice
        if not self._wheels.add(reading):
            self._head = None  # it has passed the time of the reading
        newest_ns, about_ns = self._history.newest_ns, self._motion.about_ns
        if newest_ns is None:
            self._predictions.clear()
            # The first measurement counts however late it is.
            self._wheels.forget_before(reading.stamp_ns - max(self._horizon_ns, _LATEST_NS) - about_ns)
        elif reading.stamp_ns < newest_ns - self._horizon_ns:
            self._predictions.clear()
        elif self._history.invalidate(before_ns, about_ns):  # the motion at some exposures was guessed
            self._predictions.clear()
            self._head = None
        else:
            self._predictions = {t: pose for t, pose in self._predictions.items() if t <= newest_ns}

    def add_detections(self, detections: Detections) -> None:
        """Add the tags of one exposure; tags of other units and empty frames change nothing."""
        if any(t.tag_id in self.target.corners_D for t in detections.tags):
            self._insert(detections)

    def add_pose(self, measurement: PoseMeasurement) -> None:
        """Add a measured pose."""
        self._insert(measurement)

    def expect_push(self, from_ns: int, until_ns: int) -> None:
        """Expect that another unit may push the target: what the wheels tell between is not all that moves.

        Otherwise what moves it would be taken for errors of calibration and of the wheels, which stay.
        Measurements that were exposed between and have been added before change only if others that arrive
        late have them processed again.
        """
        pushed = self._step.pushed_ns
        if pushed and pushed[-1][1] >= from_ns:
            first_ns, last_ns = pushed.pop()
            from_ns, until_ns = min(from_ns, first_ns), max(until_ns, last_ns)
        oldest_ns = from_ns - 2 * self._horizon_ns
        pushed[:] = [span for span in pushed if span[1] >= oldest_ns] + [(from_ns, until_ns)]

    def predict(self, stamp_ns: int) -> PoseEstimate | None:
        """Return the pose at an instant, past (within the horizon) or future, from all measurements."""
        if stamp_ns not in self._predictions:  # several callers ask for the same instant
            self._predictions[stamp_ns] = self._predict(stamp_ns)
        return self._predictions[stamp_ns]

    def _predict(self, stamp_ns: int) -> PoseEstimate | None:
        state = self._history.state_before(stamp_ns)
        if state is None:
            return None
        moved = self._advance_head(state, stamp_ns) if state is self._history.newest else state
        return self._pose(moved, state.alternatives, stamp_ns)

    def _pose(self, state: FilterState, alternatives: Sequence[FilterState], stamp_ns: int) -> PoseEstimate:
        """Return the pose of a state at an instant, with a covariance that covers its alternatives."""
        pose = self._motion.predict(state, self._wheels, stamp_ns)
        if not alternatives:
            return pose
        others = [self._motion.predict(other, self._wheels, stamp_ns) for other in alternatives]
        return mixed([pose, *others], [0.0, *(other.cost for other in alternatives)])

    def velocity(self, stamp_ns: int) -> Array:
        """Return the velocity of (x, y, yaw) in D, shape (3,) [m/s, rad/s], by the wheels; 0 when lost."""
        state = self._history.state_before(stamp_ns)
        if state is None:
            return np.zeros(3)
        return self._motion.velocity(self._advance_head(state, stamp_ns), self._wheels)

    def estimate(self, now_ns: int) -> PoseEstimate | None:
        """Return the pose for control: of now, or without delay compensation of the last exposure."""
        if self.delay_compensation:
            return self.predict(now_ns)
        state = self._history.state_before(now_ns)
        return None if state is None else self._pose(state, state.alternatives, state.stamp_ns)

    def drive_errors(self) -> tuple[float, float, float]:
        """Return what is known of the relative errors of the left and right radius and of the track.

        They are those of the motion by a command. An error of the encoders is left out as far as the data
        sheets tell one from the other: by the share of its variance.
        """
        state = self._history.newest
        known = self._step.known.mean[:DRIVE_SIZE] if state is None else state.mean[POSE_SIZE:_DRIVE_END]
        (left, right, track), (by_left, by_right, by_track) = known.tolist(), self._motion.in_motion
        return by_left * left, by_right * right, by_track * track

    @property
    def clock_ahead_s(self) -> float:
        """By how much the clock of the camera is ahead, as far as that is known [s]."""
        column, state = self.target.filter_layout.clock, self._history.newest
        return 0.0 if column is None or state is None else float(state.mean[column])

    @property
    def exposures(self) -> ExposureCounts:
        """What became of the exposures since the last reset."""
        state = self._history.newest
        return ExposureCounts() if state is None else state.exposures

    @property
    def prior(self) -> CalibrationEstimate:
        """What the drawing and its tolerances say of the errors of calibration."""
        return self._motion.prior

    def recall(self, estimate: CalibrationEstimate) -> None:
        """Start from what was learned earlier, instead of from the drawing alone."""
        self._step.known = estimate

    def learned(self, seated: bool) -> CalibrationEstimate | None:
        """Return what is known of the errors of calibration; None while nothing was seen.

        Args:
            seated: Whether the unit is locked in its seat. Then it knows how far it is from the face of the
                port and how it is turned, but hardly where to the side: the throat of the holes leaves play.
        """
        state = self._history.newest
        if state is None:
            return None
        if seated:
            state = in_seat(self.target, state)
        return CalibrationEstimate(
            state.mean[POSE_SIZE:], state.covariance[POSE_SIZE:, POSE_SIZE:], self.prior.shared
        )

    def calibration_errors(self) -> tuple[EstimatedCalibrationError, ...]:
        """Return what is known of every error of calibration that has a name; none while nothing was seen."""
        learned = self.learned(seated=False)
        return () if learned is None else calibration_errors(self.target.filter_layout, self.prior, learned)

    def _advance_head(self, base: FilterState, stamp_ns: int) -> FilterState:
        """Return the state at the newest reading before ``stamp_ns``, cached to do no step twice."""
        head = base
        if self._head is not None and self._head[0] is base and self._head[1].stamp_ns <= stamp_ns:
            head = self._head[1]
        until_ns = self._wheels.newest_stamp(stamp_ns)
        if until_ns is not None and until_ns > head.stamp_ns:
            head = self._motion.propagate(head, self._wheels, until_ns)
            self._head = (base, head)
        return head

    def _insert(self, measurement: Measurement) -> None:
        if self._history.insert(measurement):
            self._predictions.clear()
            self._head = None
            self._wheels.forget_before(self._history.needed_from_ns - self._motion.about_ns)
