"""The drive between a velocity command and the wheels: nested limits of speed and acceleration."""

from __future__ import annotations

from msrr_control.kinematics.drive_limits import nested_limit
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import Twist
from msrr_scenes.specs.vehicle import LimitsSpec

_AT_REST = Twist()


def wheel_speeds(twist: Twist, geometry: UnitGeometry) -> tuple[float, float]:
    """Return the speeds of the left and the right wheel [rad/s] with which a unit moves at ``twist``."""
    turn = 0.5 * geometry.track * twist.w
    return (twist.v - turn) / geometry.wheel_radius, (twist.v + turn) / geometry.wheel_radius


class LimitedDrive:
    """A drive whose velocity follows the command within nested limits (Zheng et al., eq. 3).

    Attributes:
        velocity: Velocity that the wheels are commanded; not a measurement.
    """

    def __init__(self, limits: LimitsSpec) -> None:
        """Start at rest; ``v`` and ``w`` are limited separately."""
        self._limits = limits
        self.velocity = Twist()

    def step(self, command: Twist, dt: float) -> Twist:
        """Advance the velocity towards ``command`` by ``dt`` [s] and return it."""
        if self.velocity == command == _AT_REST:
            return self.velocity
        lim, v, w = self._limits, float(command.v), float(command.w)
        self.velocity = Twist(
            nested_limit(self.velocity.v, v, lim.v_max_mps, lim.a_max_mps2, lim.kappa_per_s, dt),
            nested_limit(self.velocity.w, w, lim.w_max_radps, lim.dw_max_radps2, lim.kappa_per_s, dt),
        )
        return self.velocity
