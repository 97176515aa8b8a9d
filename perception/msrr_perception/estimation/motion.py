"""How the filter's state moves with the wheels, and how uncertain that makes it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from msrr_perception.estimation.wheel_history import WheelAngles, WheelHistory
from msrr_perception.kernels.drive import Drive, drive_along
from msrr_perception.pose.target import TargetModel
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import seconds
from msrr_scenes.specs.sensors import OdometrySpec

#: x, y, yaw of U in D; pitch and roll of the pair; relative radius errors of the left and right wheel.
STATE_SIZE = 7

#: Radii are never known better than this, whatever the scene says of its encoders.
_LEAST_SCALE_SIGMA = 0.003


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """The filter's belief at one instant.

    Attributes:
        stamp_ns: The instant.
        mean: ``(x, y, yaw, pitch, roll, scale left, scale right)``, shape (7,) [m, rad, -].
        covariance: Shape (7, 7).
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
        """The planar pose."""
        return SE2(*self.mean[:3])


@dataclass(frozen=True, slots=True)
class MotionNoise:
    """Random motion that the encoders do not tell of, as variance per length or per time.

    Attributes:
        slip: Along each wheel [m per square root of a metre driven].
        sideways: Across the wheels [m per square root of a metre driven].
        contact: Along the unit, within ``contact_zone`` of the target's face, where the wheels may spin
            while the unit stands [m per square root of a metre driven].
        guidance: Sideways, and along each wheel, in that zone, where the holes guide the pins and turn the
            unit [m per square root of a metre driven].
        contact_zone: Gap between the faces below which that may be [m].
        drift: Of the position of a unit at rest [m per square root of a second].
        turn_drift: Of its yaw [rad per square root of a second].
        tilt_sigma: Of pitch and roll [rad].
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
        """Return a fresh belief from a pose with tilt, shapes (5,) and (5, 5)."""
        full, P = np.zeros(STATE_SIZE), np.zeros((STATE_SIZE, STATE_SIZE))
        full[:5] = mean
        P[:5, :5] = covariance
        P[5, 5] = P[6, 6] = self._scale_sigma**2
        return FilterState(stamp_ns, full, P, wheels, stamp_ns)

    def propagate(self, state: FilterState, history: WheelHistory, stamp_ns: int) -> FilterState:
        """Move a belief forward to ``stamp_ns`` along the encoder readings."""
        if stamp_ns <= state.stamp_ns:
            return state
        wheels = state.wheels or history.at(state.stamp_ns)
        if wheels is None:
            return self._moved(state, stamp_ns, [(0.0, 0.0, seconds(stamp_ns - state.stamp_ns))], None)
        steps, before_ns = [], state.stamp_ns
        for now in history.way(state.stamp_ns, stamp_ns):
            dt = seconds(now.stamp_ns - before_ns)
            steps.append((now.left - wheels.left, now.right - wheels.right, dt))
            wheels, before_ns = now, now.stamp_ns
        return self._moved(state, stamp_ns, steps, wheels)

    def _moved(
        self,
        state: FilterState,
        stamp_ns: int,
        steps: Sequence[tuple[float, float, float]],
        wheels: WheelAngles | None,
    ) -> FilterState:
        """Return the belief after ``steps``: angles turned left and right [rad], time taken [s]."""
        mean, P = drive_along(
            state.mean, state.covariance, np.array(steps, dtype=np.float64).reshape(-1, 3), self._drive
        )
        return FilterState(stamp_ns, mean, P, wheels, state.last_seen_ns, state.rejected)
