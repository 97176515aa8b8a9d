"""How the filter's state moves with the wheels, and how uncertain that makes it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from msrr_perception.target import TargetModel
from msrr_perception.wheel_history import WheelAngles, WheelHistory
from msrr_scenes.messages import Array, seconds
from msrr_scenes.se2 import SE2
from msrr_scenes.sensors import OdometrySpec

#: x, y, yaw of U in D; pitch and roll of the pair; relative radius errors of the left and right wheel.
STATE_SIZE = 7
_SCALES = slice(5, 7)

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
        self._radius = target.wheel_radius
        self._track = target.track
        self._front = target.front
        self._noise = noise
        self._scale_sigma = max(odometry.scale_error, _LEAST_SCALE_SIGMA)
        # Encoder noise grows with the angle turned, so it has the form of slip.
        self._wheel_variance = noise.slip**2 + odometry.noise_rad**2 * self._radius

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
            return self._wait(state, stamp_ns)
        mean, P = state.mean.copy(), state.covariance
        before_ns = state.stamp_ns
        for now in history.way(state.stamp_ns, stamp_ns):
            P = self._step(
                mean, P, now.left - wheels.left, now.right - wheels.right, seconds(now.stamp_ns - before_ns)
            )
            wheels, before_ns = now, now.stamp_ns
        return replace(state, stamp_ns=stamp_ns, mean=mean, covariance=P, wheels=wheels)

    def _wait(self, state: FilterState, stamp_ns: int) -> FilterState:
        mean = state.mean.copy()
        P = self._step(mean, state.covariance, 0.0, 0.0, seconds(stamp_ns - state.stamp_ns))
        return replace(state, stamp_ns=stamp_ns, mean=mean, covariance=P)

    def _step(self, mean: Array, P: Array, left: float, right: float, dt: float) -> Array:
        """Move ``mean`` in place by wheel angles [rad]; return the new covariance."""
        noise = self._noise
        x, y, yaw, _, _, scale_left, scale_right = mean.tolist()
        d_left, d_right = self._radius * left, self._radius * right
        turn = (d_right * (1.0 + scale_right) - d_left * (1.0 + scale_left)) / self._track
        forward = 0.5 * (d_right * (1.0 + scale_right) + d_left * (1.0 + scale_left))
        half = 0.5 * turn
        chord = forward * (math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        c, s = math.cos(yaw + half), math.sin(yaw + half)
        keep = math.exp(-dt / noise.tilt_time)

        F = np.eye(STATE_SIZE)
        F[0, 2], F[1, 2] = -chord * s, chord * c
        for column, sign, d in ((5, -1.0, d_left), (6, 1.0, d_right)):
            turn_rate = sign * d / self._track
            F[0, column] = 0.5 * (d * c - chord * s * turn_rate)
            F[1, column] = 0.5 * (d * s + chord * c * turn_rate)
            F[2, column] = turn_rate
        F[3, 3] = F[4, 4] = keep
        P_new: Array = F @ P @ F.T
        at_port = -x - self._front < noise.contact_zone
        P_new[:3, :3] += self._slip(abs(d_left), abs(d_right), c, s, dt, at_port)
        P_new[3, 3] += (1.0 - keep * keep) * noise.tilt_sigma**2
        P_new[4, 4] += (1.0 - keep * keep) * noise.tilt_sigma**2

        mean[0], mean[1] = x + chord * c, y + chord * s
        mean[2] = math.remainder(yaw + turn, 2.0 * math.pi)
        mean[3:5] *= keep
        return P_new

    def _slip(self, left: float, right: float, c: float, s: float, dt: float, at_port: bool) -> Array:
        """Return the covariance that one step adds to (x, y, yaw), shape (3, 3).

        Args:
            left: Way of the left wheel, not negative [m].
            right: Way of the right wheel [m].
            c: Cosine of the heading.
            s: Its sine.
            dt: Duration [s].
            at_port: The wheels may spin, and the holes guide the pins.
        """
        noise, way = self._noise, 0.5 * (left + right)
        rest = noise.drift**2 * dt
        per_wheel, forward, side = self._wheel_variance, rest, noise.sideways**2 * way + rest
        if at_port:
            per_wheel += noise.guidance**2
            forward += noise.contact**2 * way
            side += noise.guidance**2 * way
        v_left, v_right = per_wheel * left, per_wheel * right
        forward += 0.25 * (v_left + v_right)
        turn = (v_left + v_right) / self._track**2 + noise.turn_drift**2 * dt
        both = 0.5 * (v_right - v_left) / self._track  # forward and turn together
        cross = c * s * (forward - side)
        return np.array(
            [
                [c * c * forward + s * s * side, cross, c * both],
                [cross, s * s * forward + c * c * side, s * both],
                [c * both, s * both, turn],
            ]
        )
