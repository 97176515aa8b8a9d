"""Unicycles whose measurements are disturbed: what both studies simulate their trials with."""

from __future__ import annotations

from collections import deque

import numpy as np
from pydantic import Field

from msrr_control.kinematics.drive_limits import nested_limit_twist
from msrr_control.kinematics.unicycle import advance_pose, apply_motion, slipping_twist
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import NonNegative, Positive, Spec
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

    sigma_xy_m: NonNegative = 0.0
    sigma_yaw_deg: NonNegative = 0.0
    sigma_bearing_deg: NonNegative = 0.0
    delay_s: NonNegative = Field(default=0.0, le=2.0)
    compensated: bool = True
    slip: NonNegative = Field(default=0.0, le=0.2)
    track_m: Positive = 0.13

    def draw_grips(self, trials: int, rng: np.random.Generator) -> Array:
        """Draw the share of its encoder's path that each wheel (left, right) covers, shape (trials, 2)."""
        grips: Array = 1.0 + self.slip * rng.uniform(-1.0, 1.0, (trials, 2))
        return grips

    @property
    def pose_sigma(self) -> Array:
        """Standard deviations of a measured pose [m, m, rad]."""
        return np.array([self.sigma_xy_m, self.sigma_xy_m, np.radians(self.sigma_yaw_deg)])

    def delay_steps(self, dt: float) -> int:
        """Return the delay in steps of ``dt`` [s]."""
        return round(self.delay_s / dt)


class DisturbedUnicycles:
    """Unicycles behind the nested limits of eq. 3, with measured poses, odometry and slipping wheels.

    Attributes:
        pose: True axle pose, shape (trials, 3).
        twist: Speeds behind the limits, as the encoders measure them, shape (trials, 2).
    """

    def __init__(
        self, pose: Array, disturbance: Disturbance, limits: LimitsSpec, dt: float, rng: np.random.Generator
    ) -> None:
        """Place the units at rest and draw the grip of their wheels.

        Args:
            pose: Axle poses at the start, shape (trials, 3).
            disturbance: Noise and delay of the measured pose, and slip.
            limits: What the drives can do.
            dt: Control period [s].
            rng: Draws the grips here, and the noise at every measurement.
        """
        trials = len(pose)
        self.pose, self.twist = pose, np.zeros((trials, 2))
        self._disturbance, self._limits, self._dt, self._rng = disturbance, limits, dt, rng
        self._grips = disturbance.draw_grips(trials, rng) if disturbance.slip else np.ones((trials, 2))
        self._odometry = pose
        self._delayed: deque[tuple[Array, Array]] = deque(maxlen=disturbance.delay_steps(dt) + 1)

    def measure(self) -> tuple[Array, Array]:
        """Measure the poses once a step.

        Returns:
            The measured pose as it arrives now, that is, late; and what the law gets: that pose moved forward
            by the odometry since its exposure, or the same pose if delays are not compensated.
        """
        noise = self._disturbance.pose_sigma * self._rng.standard_normal(self.pose.shape)
        self._delayed.append((self._odometry, self.pose + noise))
        exposed_at, late = self._delayed[0]
        if not self._disturbance.compensated:
            return late, late
        return late, apply_motion(late, exposed_at, self._odometry)

    def advance(self, command: Array) -> None:
        """Drive by a command (v, w), shape (trials, 2), for one control period."""
        self.twist = nested_limit_twist(self.twist, command, self._limits, self._limits.kappa_per_s, self._dt)
        self._odometry = advance_pose(self._odometry, self.twist, self._dt)
        true_twist = slipping_twist(self.twist, self._grips, self._disturbance.track_m)
        self.pose = advance_pose(self.pose, true_twist, self._dt)
