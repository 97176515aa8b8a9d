"""The way from the drive of a unit to the turning of its wheels, as the drivetrain was built."""

from __future__ import annotations

import math

from msrr_bullet.plant.limited_drive import wheel_speeds
from msrr_scenes.as_built import BuiltDrive
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import Twist

#: Speed of a wheel below which a motor is to stop, and has stopped [rad/s]: a tenth of a millimetre a second.
STOPPED_RADPS = 3e-3

Sides = tuple[float, float]

_AT_REST: Sides = (0.0, 0.0)


class Drivetrain:
    """Two motors with gears and wheels.

    The drive turns a velocity into speeds of the motors by the *drawn* radius and track. A motor follows with
    a lag of first order and does not turn in its dead zone. The gear has play: a wheel stands until its motor
    has taken it up. How far the unit moves is decided by the true radii and the true track. ``play`` is the
    angle of the left and the right motor ahead of the wheel [rad]. All of an ``ideal`` one is as designed.
    """

    def __init__(self, drawn: UnitGeometry, built: BuiltDrive) -> None:
        """Start at rest, with the motors in the middle of their play."""
        self._drawn, self._built = drawn, built
        self._motors = _AT_REST
        self.ideal = built.ideal
        self.play: Sides = (0.0, 0.0)

    @property
    def at_rest(self) -> bool:
        """Whether both motors have stopped."""
        return self._motors == _AT_REST

    def step(self, velocity: Twist, dt: float) -> Sides:
        """Advance by ``dt`` [s] towards a velocity; return the speeds of the left and right wheel [rad/s]."""
        if self.at_rest and not (velocity.v or velocity.w):
            return _AT_REST  # most units, at most ticks
        left, right = wheel_speeds(velocity, self._drawn)
        if self.ideal:
            return left, right
        # The part of the difference that a motor keeps in this time.
        kept = math.exp(-dt / self._built.lag_s) if self._built.lag_s > 0.0 else 0.0
        (motor_left, motor_right), (play_left, play_right) = self._motors, self.play
        left, motor_left, play_left = self._wheel(left, motor_left, play_left, kept, dt)
        right, motor_right, play_right = self._wheel(right, motor_right, play_right, kept, dt)
        self._motors, self.play = (motor_left, motor_right), (play_left, play_right)
        return left, right

    def motion(self, speeds: Sides) -> Twist:
        """Return the velocity of a unit whose wheels roll at these speeds (left, right) [rad/s]."""
        radius, scale = self._drawn.wheel_radius, self._built.radius_scale
        left, right = radius * scale[0] * speeds[0], radius * scale[1] * speeds[1]
        return Twist(0.5 * (left + right), (right - left) / (self._built.track_scale * self._drawn.track))

    def rolling(self, motion: Twist) -> Sides:
        """Return the speeds of the wheels [rad/s] that roll as a unit moves; inverse of :meth:`motion`."""
        if self.ideal:
            return wheel_speeds(motion, self._drawn)
        left, right = wheel_speeds(Twist(motion.v, self._built.track_scale * motion.w), self._drawn)
        return left / self._built.radius_scale[0], right / self._built.radius_scale[1]

    def _wheel(
        self, wanted: float, motor: float, play: float, kept: float, dt: float
    ) -> tuple[float, float, float]:
        """Return the speeds of a wheel and of its motor, and the play that the motor is ahead afterwards."""
        if abs(wanted) < self._built.dead_zone_radps:
            wanted = 0.0
        motor = wanted + (motor - wanted) * kept
        if abs(wanted) < STOPPED_RADPS and abs(motor) < STOPPED_RADPS:
            motor = 0.0
        limit = 0.5 * self._built.backlash_rad
        ahead = play + motor * dt
        play = limit if ahead > limit else -limit if ahead < -limit else ahead
        return (ahead - play) / dt, motor, play
