"""Wheel encoders: the measured angles of the wheels of a unit."""

from __future__ import annotations

import math

import numpy as np

from msrr_scenes.messages import WheelOdometry
from msrr_scenes.specs.sensors import OdometrySpec

#: Readings whose noise is drawn at once: the same numbers, without a call of the generator for each.
_DRAWN_AT_ONCE = 64


class WheelEncoders:
    """Two incremental encoders with slip, noise and a finite resolution.

    The robot does not know the radius of a wheel exactly: the angle is measured too large or too small by a
    factor that is drawn once per trial. A random walk is added whose variance grows with the angle turned,
    forwards or backwards. The reading is quantised last. ``scale`` is the measured over the true angle of the
    left and the right wheel.
    """

    def __init__(
        self,
        unit: str,
        spec: OdometrySpec,
        rng: np.random.Generator,
        stuck_from_ns: tuple[float, float] = (math.inf, math.inf),
    ) -> None:
        """Draw the scale errors.

        No other object uses ``rng``, of the stream ``unit/<name>/odometry``. From ``stuck_from_ns`` on the
        reading of the left and of the right wheel stays the same.
        """
        self._unit = unit
        self._tick, self._noise_rad = 2.0 * math.pi / spec.ticks_per_turn, spec.noise_rad
        self._rng = rng
        self._noise: list[list[float]] = []  # drawn ahead, the next one last
        left, right = rng.standard_normal(2)
        self.scale = (1.0 + spec.scale_error * float(left), 1.0 + spec.scale_error * float(right))
        self._stuck_from_ns = stuck_from_ns
        self._true: tuple[float, float] | None = None
        self._measured = [0.0, 0.0]

    def read(self, angles: tuple[float, float], stamp_ns: int) -> WheelOdometry:
        """Return the reading for true angles of the motors behind gears [rad]; the first one is zero."""
        # The number of draws per reading does not depend on the motion.
        if not self._noise:
            self._noise = self._rng.standard_normal((_DRAWN_AT_ONCE, 2)).tolist()[::-1]
        noise, before, tick = self._noise.pop(), self._true or angles, self._tick
        if angles != before:  # else nothing is added to a measured angle
            for i in range(2):
                if stamp_ns >= self._stuck_from_ns[i]:
                    continue
                turned = angles[i] - before[i]
                walk = self._noise_rad * math.sqrt(abs(turned)) * noise[i]
                self._measured[i] += self.scale[i] * turned + walk
        self._true = angles
        left, right = self._measured
        return WheelOdometry(
            self._unit, stamp_ns, tick * math.floor(left / tick), tick * math.floor(right / tick)
        )
