"""Unicycles whose measurements are disturbed: what both studies simulate their trials with."""

from __future__ import annotations

from collections import deque

import numpy as np
from pydantic import Field

from msrr_control.kinematics.controlled_point import rotate
from msrr_control.kinematics.unicycle import advance_pose, drive
from msrr_scenes.arrays import Array
from msrr_scenes.errors import ProgramFailedError
from msrr_scenes.specs.spec import Distance, Length, NonNegative, Spec, Time, Turn
from msrr_scenes.specs.vehicle import LimitsSpec


class Disturbance(Spec):
    """Errors of the measurements of a study.

    Attributes:
        sigma_xy_m: Standard deviation of the measured position, drawn anew every step.
        sigma_yaw_deg: Standard deviation of the measured heading.
        sigma_bearing_deg: Standard deviation of each edge angle.
        delay_s: Age of pose and angles when the law gets them.
        compensated: Whether each delayed pose, and the angles with it, is moved forward by the odometry since
            its exposure.
        slip: Largest share by which a wheel's path differs from that of its encoder; drawn uniformly for each
            wheel of each trial.
        track_m: Distance between the wheels.
    """

    sigma_xy_m: Distance = 0.0
    sigma_yaw_deg: Turn = 0.0
    sigma_bearing_deg: Turn = 0.0
    delay_s: Time = Field(default=0.0, le=2.0)
    compensated: bool = True
    slip: NonNegative = Field(default=0.0, le=0.2)
    track_m: Length = 0.13


class DisturbedUnicycles:
    """Unicycles behind the nested limits of eq. 3, with measured poses, odometry and slipping wheels.

    Attributes:
        pose: True axle pose, shape (trials, 3).
        twist: Speeds behind the limits, as the encoders measure them, shape (trials, 2).
    """

    def __init__(
        self, pose: Array, disturbance: Disturbance, limits: LimitsSpec, dt: float, rng: np.random.Generator
    ) -> None:
        """Place the units at rest at ``pose``, shape (trials, 3); the control period is ``dt`` [s]."""
        self.pose, self.twist = pose, np.zeros((len(pose), 2))
        self._disturbance, self._limits, self._dt, self._rng = disturbance, limits, dt, rng
        self._odometry = pose
        self._grips = np.ones((len(pose), 2))  # share of its encoder's path that each wheel covers
        if disturbance.slip:
            self._grips += disturbance.slip * rng.uniform(-1.0, 1.0, (len(pose), 2))
        self.delay_steps = round(disturbance.delay_s / dt)
        self._delayed: deque[tuple[Array, Array]] = deque(maxlen=self.delay_steps + 1)

    def measure(self) -> tuple[Array, Array]:
        """Measure the poses, once a step.

        Returns:
            The measured poses as they arrive, that is, late; and the poses that the law gets: moved forward
            by the odometry since their exposure, or the late ones if delays are not compensated.
        """
        d = self._disturbance
        sigma = np.array([d.sigma_xy_m, d.sigma_xy_m, np.radians(d.sigma_yaw_deg)])
        measured = self.pose + sigma * self._rng.standard_normal(self.pose.shape)
        self._delayed.append((self._odometry, measured))
        then, late = self._delayed[0]
        if not d.compensated:
            return late, late
        motion = self._odometry - then
        moved = late + motion
        moved[:, :2] = late[:, :2] + rotate(motion[:, :2], late[:, 2] - then[:, 2])
        return late, moved

    @property
    def age_s(self) -> float:
        """Time since the instant that the last measured poses describe, as the law gets them [s]."""
        return 0.0 if self._disturbance.compensated else self._dt * (len(self._delayed) - 1)

    def advance(self, command: Array) -> None:
        """Drive by a command (v, w), shape (trials, 2), for one control period."""
        dt, track = self._dt, self._disturbance.track_m
        self.twist, mean = drive(self.twist, command, self._limits, dt)
        v, w = mean[:, 0], mean[:, 1]
        self._odometry = advance_pose(self._odometry, dt * v, dt * w)
        left, right = self._grips[:, 0] * (v - 0.5 * track * w), self._grips[:, 1] * (v + 0.5 * track * w)
        self.pose = advance_pose(self.pose, dt * (0.5 * (left + right)), dt * ((right - left) / track))


def checked_commands(command: object, shape: tuple[int, ...], law: object) -> Array:
    """Return the commands of a law, which may be a user's own.

    Args:
        command: What the law returned.
        shape: Shape that they have to have.
        law: The law, whose class is named.

    Raises:
        ProgramFailedError: They are no finite numbers of that shape.
    """
    checked = np.asarray(command)
    if checked.shape != shape or checked.dtype.kind not in "fiu" or not np.isfinite(checked).all():
        what = "commands that are not finite" if checked.shape == shape else f"shape {checked.shape}"
        name = type(law).__name__
        raise ProgramFailedError(f"{name}.step returned {what}; expected finite numbers of shape {shape}")
    return checked
