"""Wheel encoders: what a unit is told about the angles its wheels have turned."""

from __future__ import annotations

import math

import numpy as np

from msrr_scenes.messages import WheelOdometry
from msrr_scenes.specs.sensors import OdometrySpec


class WheelEncoders:
    """Two incremental encoders with slip, noise and a finite resolution.

    Each wheel has a radius that the robot does not know exactly: its angle is told too large or too small by
    a factor drawn once per trial. On top of that the reading wanders as a random walk whose variance grows
    with the angle turned, forwards or backwards. The reading is quantised last.
    """

    def __init__(self, unit: str, spec: OdometrySpec, rng: np.random.Generator) -> None:
        """Draw the scale errors.

        Args:
            unit: Name of the unit, for the messages.
            spec: Resolution, scale error and noise.
            rng: The stream ``unit/<name>/odometry``, owned by these encoders from now on.
        """
        self._unit = unit
        self._spec = spec
        self._rng = rng
        left, right = rng.standard_normal(2)
        self.scale = (1.0 + spec.scale_error * float(left), 1.0 + spec.scale_error * float(right))
        self._true: tuple[float, float] | None = None
        self._told = [0.0, 0.0]

    def read(self, wheel_angles: tuple[float, float], stamp_ns: int) -> WheelOdometry:
        """Return the reading for true wheel angles [rad]; the first call is power-up and reads zero."""
        # The same number of draws per reading, turned or not, keeps the stream in step.
        noise = self._rng.standard_normal(2)
        before = self._true or wheel_angles
        for i in range(2):
            turned = wheel_angles[i] - before[i]
            wander = self._spec.noise_rad * math.sqrt(abs(turned)) * float(noise[i])
            self._told[i] += self.scale[i] * turned + wander
        self._true = wheel_angles
        tick = 2.0 * math.pi / self._spec.ticks_per_turn
        left, right = (tick * math.floor(angle / tick) for angle in self._told)
        return WheelOdometry(self._unit, stamp_ns, left, right)
