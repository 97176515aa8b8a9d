"""The drive between a velocity command and the wheels: nested limits of speed and acceleration."""

from __future__ import annotations

from msrr_control.kinematics.drive_limits import nested_limiter
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import Twist
from msrr_scenes.specs.vehicle import LimitsSpec


def wheel_speeds(twist: Twist, geometry: UnitGeometry) -> tuple[float, float]:
    """Return the speeds of the left and the right wheel [rad/s] with which a unit moves at ``twist``."""
    turn = 0.5 * geometry.track * twist.w
    return (twist.v - turn) / geometry.wheel_radius, (twist.v + turn) / geometry.wheel_radius


class LimitedDrive:
    """A drive whose velocity follows the command within nested limits (Zheng et al., eq. 3).

    Its ``velocity`` is what the wheels are commanded, not a measurement.
    """

    def __init__(self, limits: LimitsSpec, dt: float) -> None:
        """Start at rest; ``v`` and ``w`` are limited separately, in steps of ``dt`` [s]."""
        kappa = limits.kappa_per_s
        self._limited_v = nested_limiter(limits.v_max_mps, limits.a_max_mps2, kappa, dt)
        self._limited_w = nested_limiter(limits.w_max_radps, limits.dw_max_radps2, kappa, dt)
        self.velocity = Twist()

    def step(self, command: Twist) -> Twist:
        """Advance the velocity towards ``command`` by one step and return it."""
        before = self.velocity
        if before.v or before.w or command.v or command.w:  # a drive at rest stays there
            v, w = float(command.v), float(command.w)
            self.velocity = Twist(self._limited_v(before.v, v), self._limited_w(before.w, w))
        return self.velocity
