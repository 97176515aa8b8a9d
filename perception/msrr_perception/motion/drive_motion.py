"""The motion model of the corner filter: how the state and its covariance move with the wheels."""

from __future__ import annotations

import math

import numpy as np

from msrr_perception.kernels.dock_frame import predict
from msrr_perception.kernels.drive import Drive, is_at_port, propagate
from msrr_perception.kernels.rates import ABOUT_S, AT_REST, Rates, rates_by_wheels
from msrr_perception.motion.filter_state import CalibrationEstimate, FilterState
from msrr_perception.motion.motion_noise import MotionNoise
from msrr_perception.motion.wheel_history import WheelAngles, WheelHistory
from msrr_perception.pose.calibration import DRIVE_SIZE, POSE_SIZE
from msrr_perception.pose.target import YAW, TargetModel
from msrr_scenes.arrays import Array, frozen
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import NS_PER_S, PoseEstimate, seconds
from msrr_scenes.specs.sensors import OdometrySpec

#: Smallest standard deviation of a relative radius error, whatever the scene says of its encoders, and of a
#: relative error of the track.
_LEAST_SCALE_SIGMA, _LEAST_TRACK_SIGMA = 0.003, 0.003

#: Standard deviations of the clock of a camera within which an exposure is, and the largest time from one to
#: the next instant whose velocity is told [s].
_CLOCK_SIGMAS, _STEP_S = 3.0, 0.01

#: Distance driven and angle turned over which the variance of the relative error of measured lengths, the
#: strain, is added to the wheels' errors once [m, rad].
_STRAINED_M, _STRAINED_RAD = 2.0, 1.0

#: Distance driven between two measurements [m]: the strain turns the direction of each such way, by an angle
#: of its own.
_STEP_M = 0.025

#: Way that the wheels tell of between two measurements from which on it can be seen whether a unit at a port
#: moves or they spin [m], and the share of it by which one that moves is seen to move.
_MOVED_M, _MOVED_SHARE = 0.0003, 0.5


class DriveMotion:
    """Differential-drive motion of the state, exact for constant wheel speeds between two readings.

    The radius errors of the wheels are constant through a trial, so they are states and not white noise.

    Attributes:
        prior: What the drawing and its tolerances say of everything in a state but the pose.
        in_motion: Share of the errors of both radii and of the track, as the state has them, that act on the
            motion and not on the readings alone.
        learns_clock: Whether the time by which the clock of the camera is ahead is in the state.
        about_ns: Largest time before and after the stamp of an exposure in which the wheels tell how the unit
            moved about it [ns].
    """

    def __init__(self, target: TargetModel, odometry: OdometrySpec, noise: MotionNoise) -> None:
        left, right, track = target.tolerances.wheels
        wheels = [
            max(math.hypot(odometry.scale_error, left), _LEAST_SCALE_SIGMA),
            max(math.hypot(odometry.scale_error, right), _LEAST_SCALE_SIGMA),
            max(track, _LEAST_TRACK_SIGMA),
        ]
        self.in_motion = tuple((np.square([left, right, track]) / np.square(wheels)).tolist())
        layout = target.filter_layout
        covariance = np.zeros((DRIVE_SIZE + len(layout.prior),) * 2)
        covariance[:DRIVE_SIZE, :DRIVE_SIZE] = np.diag(np.square(wheels)) + noise.strain**2
        covariance[DRIVE_SIZE:, DRIVE_SIZE:] = layout.covariance
        self.prior = CalibrationEstimate(np.zeros(len(covariance)), covariance, layout.own - POSE_SIZE)
        # Two readings, each rounded to a tick.
        self._rounding = 2.0 * (2.0 * math.pi / odometry.ticks_per_turn * target.wheel_radius) ** 2 / 12.0
        self._play = 3.0 * target.tolerances.backlash
        self._clock = layout.clock
        self.learns_clock = self._clock is not None
        self._clock_within = _CLOCK_SIGMAS * target.tolerances.clock_s
        self._rows = 0.5 * target.shutter.readout_s
        self.about_ns = math.ceil((2.0 * self._clock_within + self._rows + ABOUT_S) * NS_PER_S)
        self._marker, self._pivot = -1 if layout.marker is None else layout.marker, layout.tags.pivot
        self._drive = Drive(
            radius=target.wheel_radius,
            track=target.track,
            tips=target.front + (target.mechanism.pin_length if target.mechanism else 0.0),
            contact_zone=noise.contact_zone,
            # Encoder noise grows with the angle turned, so it has the form of slip.
            wheel_variance=noise.slip**2 + odometry.noise_rad**2 * target.wheel_radius,
            sideways=noise.sideways**2,
            contact=noise.contact**2,
            guidance=noise.guidance**2,
            # Whether a wheel follows its motor is unknown until the play is taken up.
            play=0.5 * target.wheel_radius * target.tolerances.backlash,
            drift=noise.drift**2,
            turn_drift=noise.turn_drift**2,
            tilt=noise.tilt_sigma**2,
            tilt_time=noise.tilt_time,
            strained=noise.strain**2 / _STRAINED_M,
            strained_turning=noise.strain**2 / _STRAINED_RAD,
            strained_aside=noise.strain**2 * _STEP_M,
        )
        self._packed_drive = self._drive.packed()
        self._doubted, self._pushed = noise.doubted, noise.pushed
        self._acceleration = noise.acceleration

    def rates(self, state: FilterState, history: WheelHistory) -> Rates:
        """Return how the unit moves about an exposure with the time of a state as its stamp, by the wheels.

        What they did until :meth:`wheels_until` may not be known yet, and is extrapolated then.
        """
        return self._rates(state, history, *self._exposed(state))

    def standing(self, before: FilterState, told: FilterState) -> FilterState:
        """Return the state ``told``, to which the wheels moved the state ``before``, of a unit that stands.

        It is as uncertain as that of a unit at a port, whose wheels may spin.
        """
        mean = told.mean.copy()
        mean[:2], mean[YAW] = before.exposed, before.mean[YAW]
        return told._replace(mean=mean)

    def with_exposure(
        self, before: FilterState, told: FilterState, after: FilterState, rates: Rates
    ) -> FilterState:
        """Return the state after a measurement with where the unit was, and whether it stood at a port.

        Args:
            before: The state after the last measurement.
            told: The state to which the wheels moved it, up to the time of this measurement.
            after: The state after this measurement.
            rates: How the unit moved about the exposure.
        """
        place = after.mean[:2] + rates.way[len(rates.way) // 2, :2]
        by_wheels, seen = told.mean[:2] - before.mean[:2], place - before.exposed
        way = float(by_wheels @ by_wheels)
        moves = way > _MOVED_M**2 and float(by_wheels @ seen) > _MOVED_SHARE * way
        x, y = float(told.mean[0]), float(told.mean[1])
        at_port = is_at_port(x, y, self._drive.tips, self._drive.contact_zone)
        return after._replace(stood=at_port and not moves, exposed=(float(place[0]), float(place[1])))

    def velocity(self, state: FilterState, history: WheelHistory) -> Array:
        """Return the velocity of (x, y, yaw) in D at the time of a state by the wheels [m/s, rad/s], (3,)."""
        velocity: Array = self._rates(state, history, 0.0, 0.0).velocity[0]
        return velocity

    def wheels_until(self, state: FilterState) -> int:
        """Return the time until which the wheels tell the rates about an exposure at a state [ns]."""
        exposed, within = self._exposed(state)
        return state.stamp_ns + math.ceil((exposed + within + ABOUT_S) * NS_PER_S)

    def _rates(self, state: FilterState, history: WheelHistory, exposed: float, within: float) -> Rates:
        """Return the rates about a time after the stamp, with instants as long before and after it [s]."""
        readings = history.about(state.stamp_ns, math.ceil((abs(exposed) + within + ABOUT_S) * NS_PER_S))
        if not len(readings):
            return AT_REST
        steps = math.ceil(within / _STEP_S)
        step = within / steps if steps else _STEP_S
        radii = self._drive.radius * (1.0 + state.mean[5:7])
        return rates_by_wheels(
            readings, exposed, step, steps, radii, self._drive.track, float(state.mean[YAW])
        )

    def _exposed(self, state: FilterState) -> tuple[float, float]:
        """Return the time from the stamp at a state to when the exposure is thought to have been [s].

        The second is by how much, at most, a row was exposed before or after it. It is 0 below 10 ms, within
        which a velocity hardly changes: when a picture comes, the wheels have told no more.
        """
        late = doubt = 0.0
        if self._clock is not None:
            late = min(max(float(state.mean[self._clock]), -self._clock_within), self._clock_within)
            doubt = min(
                _CLOCK_SIGMAS * math.sqrt(state.covariance[self._clock, self._clock]), self._clock_within
            )
        within = doubt + self._rows
        return -late, within if within > _STEP_S else 0.0

    def propagate(self, state: FilterState, history: WheelHistory, stamp_ns: int) -> FilterState:
        """Return the state without alternatives, moved forward to ``stamp_ns`` along the encoder readings."""
        if stamp_ns <= state.stamp_ns:
            return state
        steps, wheels = self._steps(state, history, stamp_ns)
        mean, P = state.mean.copy(), state.covariance.copy()
        propagate(mean, P, steps, self._packed_drive)
        between = self._between_readings(history, state.stamp_ns, stamp_ns)
        if between > 0.0:
            self._add_of_wheels(mean, P, between)
        return state._replace(
            stamp_ns=stamp_ns,
            mean=mean,
            covariance=P,
            wheels=wheels,
            wheels_until_ns=0,
            alternatives=(),
        )

    def to_measurement(self, state: FilterState, history: WheelHistory, stamp_ns: int) -> FilterState:
        """Return the state moved forward to a measurement at ``stamp_ns``, with what encoders do not resolve.

        The rounding of a reading is part of two motions, one before and one after it, and taken to be another
        one in each: it adds up to more than it is, as slip does.
        """
        moved = self.propagate(state, history, stamp_ns)
        if moved is state or state.wheels is None or moved.wheels is None:
            return moved
        # Each wheel for itself, and also where no tick has passed: it may have turned by less than one.
        self._add_of_wheels(moved.mean, moved.covariance, self._rounding)
        return moved

    def doubting(self, state: FilterState) -> FilterState:
        """Return a state at a measurement with what the wheels have told since the last one in doubt."""
        return self._moved_otherwise(state, self._doubted * seconds(state.stamp_ns - state.last_seen_ns))

    def pushed(self, state: FilterState, since_ns: int) -> FilterState:
        """Return a state whose target may have been pushed since an instant."""
        return self._moved_otherwise(state, self._pushed * seconds(state.stamp_ns - since_ns))

    def _moved_otherwise(self, state: FilterState, way: float) -> FilterState:
        """Return a state whose pose may have changed, by a way [m], otherwise than the wheels tell."""
        moved = state._replace(covariance=state.covariance.copy())
        off = way**2
        self._add_of_wheels(moved.mean, moved.covariance, off)
        moved.covariance[[0, 1], [0, 1]] += off  # one that is pushed aside drives without its wheels
        return moved

    def _between_readings(self, history: WheelHistory, first_ns: int, last_ns: int) -> float:
        """Return the variance that accelerations add to the way of a wheel between two instants [m^2]."""
        first, last = history.off_by(first_ns), history.off_by(last_ns)
        return (self._acceleration * first) ** 2 + (self._acceleration * last) ** 2

    def _add_of_wheels(self, mean: Array, P: Array, variance: float) -> None:
        """Add an error of the way of each wheel for itself, of a variance [m^2], to a covariance in place."""
        yaw = float(mean[YAW])
        c, s = math.cos(yaw), math.sin(yaw)
        P[0, 0] += 0.5 * variance * c * c
        P[0, 1] += 0.5 * variance * c * s
        P[1, 0] += 0.5 * variance * c * s
        P[1, 1] += 0.5 * variance * s * s
        P[2, 2] += 2.0 * variance / self._drive.track**2

    def predict(self, state: FilterState, history: WheelHistory, stamp_ns: int) -> PoseEstimate:
        """Return the pose in the dock frame at ``stamp_ns``, or at the time of the state if that is later."""
        steps, P = np.zeros((0, 5)), state.covariance
        if stamp_ns > state.stamp_ns:
            steps, _ = self._steps(state, history, stamp_ns)
            between = self._between_readings(history, state.stamp_ns, stamp_ns)
            if between > 0.0:
                P = P.copy()
                self._add_of_wheels(state.mean, P, between)
        x, y, yaw, covariance = predict(state.mean, P, steps, self._packed_drive, self._marker, self._pivot)
        at_ns = max(stamp_ns, state.stamp_ns)
        return PoseEstimate(at_ns, SE2(x, y, yaw), frozen(covariance), state.last_seen_ns, state.exposures)

    def _steps(
        self, state: FilterState, history: WheelHistory, stamp_ns: int
    ) -> tuple[Array, WheelAngles | None]:
        """Return the steps from a state to a later instant, and the encoder angles at their end.

        Each of the K steps, shape (K, 5), has the angles turned left and right [rad], its duration [s], and 1
        for each side whose play is being taken up.
        """
        wheels = state.wheels or history.angles_at(state.stamp_ns)
        if wheels is None:
            return np.array([[0.0, 0.0, seconds(stamp_ns - state.stamp_ns), 0.0, 0.0]]), None
        steps: list[float] = []
        before_ns, play = state.stamp_ns, self._play
        for angles in history.angles_between(state.stamp_ns, stamp_ns):
            dt = seconds(angles.stamp_ns - before_ns)
            left, right = angles.left - wheels.left, angles.right - wheels.right
            loose_left = abs(angles.since_left - abs(left)) < play
            loose_right = abs(angles.since_right - abs(right)) < play
            steps += left, right, dt, loose_left, loose_right
            wheels, before_ns = angles, angles.stamp_ns
        return np.array(steps, dtype=np.float64).reshape(-1, 5), wheels
