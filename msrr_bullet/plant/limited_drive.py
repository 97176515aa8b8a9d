"""From a velocity command to turning wheels: nested limits, then motors with limited torque."""

from __future__ import annotations

import pybullet

from msrr_bullet.simulation.unit_body import UnitBody
from msrr_control.kinematics.drive_limits import nested_limit
from msrr_scenes.geometry.unit_geometry import UnitGeometry
from msrr_scenes.messages import Twist
from msrr_scenes.specs.vehicle import LimitsSpec, WheelMotorSpec

#: Below these speeds a drive counts as standing: the nested limits let it creep towards zero for ever.
STANDSTILL_MPS = 1e-4
STANDSTILL_RADPS = 1e-3

_AT_REST = Twist()


def wheel_speeds(twist: Twist, geometry: UnitGeometry) -> tuple[float, float]:
    """Return the speeds of the left and the right wheel [rad/s] that roll a unit along ``twist``."""
    turn = 0.5 * geometry.track * twist.w
    return (twist.v - turn) / geometry.wheel_radius, (twist.v + turn) / geometry.wheel_radius


class LimitedDrive:
    """The speeds a drive asks of its wheels: the wish behind the nested limits of Zheng et al., eq. 3."""

    def __init__(self, limits: LimitsSpec) -> None:
        """Start at rest; ``v`` and ``w`` are limited separately."""
        self._limits = limits
        self.speed = Twist()

    def step(self, wish: Twist, dt: float) -> Twist:
        """Advance the speeds towards ``wish`` by ``dt`` [s] and return them."""
        if self.speed == wish == _AT_REST:
            return self.speed
        at = self._limits
        self.speed = Twist(
            nested_limit(self.speed.v, float(wish.v), at.v_max_mps, at.a_max_mps2, at.kappa_per_s, dt),
            nested_limit(self.speed.w, float(wish.w), at.w_max_radps, at.dw_max_radps2, at.kappa_per_s, dt),
        )
        return self.speed


class WheelMotors:
    """The two velocity-controlled wheel motors of a unit in PyBullet."""

    def __init__(self, client: int, unit: UnitBody, spec: WheelMotorSpec) -> None:
        """Take over the wheels of ``unit``; they brake until told otherwise."""
        self._client = client
        self._unit = unit
        self._torque = spec.torque_nm
        self._holding = spec.holding_torque_nm
        self._told: tuple[tuple[float, float], float] | None = None
        self.drive(Twist())

    def drive(self, twist: Twist) -> None:
        """Turn the wheels for ``twist``, with no more than the motors' torque [N m]."""
        # A drive that has come to rest is held by its gear, which is stronger than its motor.
        stands = abs(twist.v) < STANDSTILL_MPS and abs(twist.w) < STANDSTILL_RADPS
        self._control(wheel_speeds(twist, self._unit.geometry), self._holding if stands else self._torque)

    def release(self) -> None:
        """Let the wheels roll freely."""
        self._control((0.0, 0.0), 0.0)

    def _control(self, speeds: tuple[float, float], torque: float) -> None:
        if (speeds, torque) == self._told:
            return  # the engine keeps a motor's target until it gets another
        self._told = (speeds, torque)
        for joint, speed in zip(self._unit.wheels, speeds, strict=True):
            pybullet.setJointMotorControl2(
                self._unit.body,
                joint,
                pybullet.VELOCITY_CONTROL,
                targetVelocity=speed,
                velocityGain=1.0,
                force=torque,
                physicsClientId=self._client,
            )
