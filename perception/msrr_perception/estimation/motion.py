"""The motion model of the corner filter: how the state and its covariance move with the wheels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msrr_perception.estimation.wheel_history import WheelAngles, WheelHistory
from msrr_perception.kernels.drive import Drive, propagate
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import seconds
from msrr_scenes.specs.sensors import OdometrySpec

#: Size of the state: x, y, yaw of U in D; pitch and roll of the pair; relative radius errors of both wheels.
STATE_SIZE = 7

#: Smallest standard deviation of a relative radius error, whatever the scene says of its encoders.
_LEAST_SCALE_SIGMA = 0.003


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """The state of the filter at one instant.

    Attributes:
        stamp_ns: Time of the state.
        mean: Mean ``(x, y, yaw, pitch, roll, scale left, scale right)``, shape (7,) [m, rad, -].
        covariance: Covariance of the mean, shape (7, 7).
        wheels: Encoder angles up to which motion is accounted for; None while no reading is known.
        last_seen_ns: Exposure time of the last measurement that passed the gate.
        rejected: Number of exposures in a row of which nothing passed the gate.
    """

    stamp_ns: int
    mean: Array
    covariance: Array
    wheels: WheelAngles | None
    last_seen_ns: int
    rejected: int = 0

    @property
    def X_DU(self) -> SE2:
        """Planar pose of the unit in the dock frame D."""
        return SE2(*self.mean[:3])


@dataclass(frozen=True, slots=True)
class MotionNoise:
    """Random motion that the encoders do not measure.

    Attributes:
        slip: Motion along each wheel [m per square root of a metre driven].
        sideways: Motion across the wheels [m per square root of a metre driven].
        contact: Motion along the unit in the contact zone, where the wheels may spin while the unit stands
            [m per square root of a metre driven].
        guidance: Motion sideways and along each wheel in the contact zone, where the holes guide the pins and
            turn the unit [m per square root of a metre driven].
        contact_zone: Gap between the faces below which the unit is in the contact zone [m].
        drift: Motion of a unit at rest [m per square root of a second].
        turn_drift: Rotation of a unit at rest [rad per square root of a second].
        tilt_sigma: Standard deviation of pitch and roll [rad].
        tilt_time: Correlation time of pitch and roll [s].
    """

    slip: float = 0.001
    sideways: float = 0.0005
    contact: float = 0.02
    guidance: float = 0.01
    contact_zone: float = 0.03
    drift: float = 0.0002
    turn_drift: float = 0.001
    tilt_sigma: float = math.radians(0.3)
    tilt_time: float = 1.0


DEFAULT_NOISE = MotionNoise()


class DriveMotion:
    """Differential-drive motion of the state, exact for constant wheel speeds between two readings.

    The radius errors of the wheels are constant through a trial, so they are states and not white noise.
    """

    def __init__(self, target: TargetModel, odometry: OdometrySpec, noise: MotionNoise) -> None:
        self._scale_sigma = max(odometry.scale_error, _LEAST_SCALE_SIGMA)
        self._drive = Drive(
            radius=target.wheel_radius,
            track=target.track,
            front=target.front,
            contact_zone=noise.contact_zone,
            # Encoder noise grows with the angle turned, so it has the form of slip.
            wheel_variance=noise.slip**2 + odometry.noise_rad**2 * target.wheel_radius,
            sideways=noise.sideways**2,
            contact=noise.contact**2,
            guidance=noise.guidance**2,
            drift=noise.drift**2,
            turn_drift=noise.turn_drift**2,
            tilt=noise.tilt_sigma**2,
            tilt_time=noise.tilt_time,
        )

    def initial(
        self, stamp_ns: int, mean: Array, covariance: Array, wheels: WheelAngles | None
    ) -> FilterState:
        """Return a first state from a pose with tilt, shape (5,), and its covariance, shape (5, 5)."""
        full, P = np.zeros(STATE_SIZE), np.zeros((STATE_SIZE, STATE_SIZE))
        full[:5] = mean
        P[:5, :5] = covariance
        P[5, 5] = P[6, 6] = self._scale_sigma**2
        return FilterState(stamp_ns, full, P, wheels, stamp_ns)

    def propagate(self, state: FilterState, history: WheelHistory, stamp_ns: int) -> FilterState:
        """Return the state moved forward to ``stamp_ns`` along the encoder readings."""
        if stamp_ns <= state.stamp_ns:
            return state
        wheels = state.wheels or history.angles_at(state.stamp_ns)
        if wheels is None:
            return self._moved(state, stamp_ns, [(0.0, 0.0, seconds(stamp_ns - state.stamp_ns))], None)
        steps, before_ns = [], state.stamp_ns
        for angles in history.angles_between(state.stamp_ns, stamp_ns):
            dt = seconds(angles.stamp_ns - before_ns)
            steps.append((angles.left - wheels.left, angles.right - wheels.right, dt))
            wheels, before_ns = angles, angles.stamp_ns
        return self._moved(state, stamp_ns, steps, wheels)

    def _moved(
        self,
        state: FilterState,
        stamp_ns: int,
        steps: Sequence[tuple[float, float, float]],
        wheels: WheelAngles | None,
    ) -> FilterState:
        """Return the state after ``steps``: angles turned left and right [rad], duration [s]."""
        mean, P = propagate(
            state.mean, state.covariance, np.array(steps, dtype=np.float64).reshape(-1, 3), self._drive
        )
        return FilterState(stamp_ns, mean, P, wheels, state.last_seen_ns, state.rejected)
