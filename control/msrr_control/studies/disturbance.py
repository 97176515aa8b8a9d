"""Unicycles whose measurements are disturbed: what both studies simulate their trials with."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from pydantic import Field

from msrr_control.kinematics.controlled_point import rotate
from msrr_control.kinematics.unicycle import advance_pose, drive
from msrr_scenes.arrays import Array
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.specs.spec import Distance, NonNegative, Spec, Time, Turn
from msrr_scenes.specs.vehicle import LimitsSpec

#: Distance between the wheels of the unit [m].
_TRACK_M = 0.13


#: Numbers of trials and control rates of a study [Hz].
TRIALS, RATES_HZ = (1, 1_000_000), (1.0, 10_000.0)


class Disturbance(Spec):
    """Errors of the measurements of a study.

    Attributes:
        sigma_xy_m: Standard deviation of the measured position, drawn anew every step.
        sigma_yaw_deg: Standard deviation of the measured heading.
        sigma_bearing_deg: Standard deviation of each edge angle.
        delay_s: Age of pose and angles when the law gets them, which need not be a number of control periods.
        compensated: Whether each delayed pose, and the angles with it, is moved forward by the odometry since
            its exposure.
        slip: Largest share by which a wheel's path differs from that of its encoder; drawn uniformly for each
            wheel of each trial.
    """

    sigma_xy_m: Distance = 0.0
    sigma_yaw_deg: Turn = 0.0
    sigma_bearing_deg: Turn = 0.0
    delay_s: Time = Field(default=0.0, le=2.0)
    compensated: bool = True
    slip: NonNegative = Field(default=0.0, le=0.2)


class DisturbedUnicycles:
    """Unicycles behind the nested limits of eq. 3, with measured poses, odometry and slipping wheels.

    Attributes:
        pose: True axle pose, shape (trials, 3).
        twist: Speeds behind the limits, as the encoders measure them, shape (trials, 2).
        exposed: True axle pose at the instant of which the last measured poses are, shape (trials, 3).
        delay_steps: Number of whole control periods within which the delay lies.
    """

    def __init__(
        self, pose: Array, disturbance: Disturbance, limits: LimitsSpec, dt: float, rng: np.random.Generator
    ) -> None:
        """Place the units at rest at ``pose``, shape (trials, 3); the control period is ``dt`` [s]."""
        self.pose, self.exposed, self.twist = pose, pose, np.zeros((len(pose), 2))
        self._disturbance, self._limits, self._dt, self._rng = disturbance, limits, dt, rng
        self._odometry = pose
        self._grips = np.ones((len(pose), 2))  # share of its encoder's path that each wheel covers
        if disturbance.slip:
            self._grips += disturbance.slip * rng.uniform(-1.0, 1.0, (len(pose), 2))
        age = disturbance.delay_s / dt
        self.delay_steps = math.ceil(age - 1e-9)
        # Share of the oldest of these periods that had passed when the measurement was made.
        self._share = max(self.delay_steps - age, 0.0)
        self._true, self._odometries, self._noise = (
            deque[Array](maxlen=self.delay_steps + 1) for _ in range(3)
        )

    def measure(self) -> tuple[Array, Array]:
        """Measure the poses, once a step.

        Returns:
            The measured poses as they arrive, that is, late; and the poses that the law gets: moved forward
            by the odometry since their exposure, or the late ones if delays are not compensated.
        """
        d = self._disturbance
        sigma = np.array([d.sigma_xy_m, d.sigma_xy_m, np.radians(d.sigma_yaw_deg)])
        self._true.append(self.pose)
        self._odometries.append(self._odometry)
        self._noise.append(sigma * self._rng.standard_normal(self.pose.shape))
        then, self.exposed = self._at_exposure(self._odometries), self._at_exposure(self._true)
        late = self.exposed + self._noise[0]
        if not d.compensated:
            return late, late
        motion = self._odometry - then
        moved = late + motion
        moved[:, :2] = late[:, :2] + rotate(motion[:, :2], late[:, 2] - then[:, 2])
        return late, moved

    def _at_exposure(self, history: Sequence[Array]) -> Array:
        oldest = history[0]
        if self._share < 1e-9 or len(history) <= self.delay_steps:
            return oldest  # the delay is a number of periods, or its first instant lies before the start
        return oldest + self._share * (history[1] - oldest)

    @property
    def age_s(self) -> float:
        """Time since the instant that the last measured poses describe, as the law gets them [s]."""
        if self._disturbance.compensated:
            return 0.0
        return min(self._disturbance.delay_s, self._dt * (len(self._true) - 1))

    def advance(self, command: Array) -> None:
        """Drive by a command (v, w), shape (trials, 2), for one control period."""
        dt = self._dt
        self.twist, mean = drive(self.twist, command, self._limits, dt)
        v, w = mean[:, 0], mean[:, 1]
        self._odometry = advance_pose(self._odometry, dt * v, dt * w)
        turning = 0.5 * _TRACK_M * w
        left, right = self._grips[:, 0] * (v - turning), self._grips[:, 1] * (v + turning)
        self.pose = advance_pose(self.pose, dt * (0.5 * (left + right)), dt * ((right - left) / _TRACK_M))


def checked_commands(command: object, shape: tuple[int, ...], law: object) -> Array:
    """Return the commands of a law, which may be a user's own.

    Raises:
        ProgramFailedError: They are no finite numbers of that shape; the class of the law is named.
    """
    checked = np.asarray(command)
    if checked.shape != shape or checked.dtype.kind not in "fiu" or not np.isfinite(checked).all():
        what = "commands that are not finite" if checked.shape == shape else f"shape {checked.shape}"
        name = type(law).__name__
        raise ProgramFailedError(f"{name}.step returned {what}; expected finite numbers of shape {shape}")
    return checked
