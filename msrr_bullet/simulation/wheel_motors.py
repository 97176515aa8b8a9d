"""The wheel motors of a unit in PyBullet."""

from __future__ import annotations

from msrr_bullet.silent_pybullet import pybullet
from msrr_bullet.simulation.unit_body import UnitBody
from msrr_scenes.messages import Twist
from msrr_scenes.specs.vehicle import WheelMotorSpec

#: Below these speeds a drive counts as stopped, because the nested limits approach zero asymptotically.
STANDSTILL_MPS = 1e-4
STANDSTILL_RADPS = 1e-3

_GAINS = (1.0, 1.0)


def is_standstill(velocity: Twist) -> bool:
    """Return whether a drive at this velocity counts as stopped."""
    return abs(velocity.v) < STANDSTILL_MPS and abs(velocity.w) < STANDSTILL_RADPS


class WheelMotors:
    """The two velocity-controlled wheel motors of a unit, with limited torque."""

    def __init__(self, client: int, unit: UnitBody, spec: WheelMotorSpec) -> None:
        """Brake the wheels of ``unit`` until the first command."""
        self._client = client
        self._unit = unit
        self._torque = spec.torque_nm
        self._holding = spec.holding_torque_nm
        self._last_target: tuple[tuple[float, float], float] | None = None
        self.drive((0.0, 0.0), held=True)

    def drive(self, speeds: tuple[float, float], *, held: bool = False) -> None:
        """Turn the wheels with limited torque.

        The speeds are those of the left and the right wheel [rad/s]. A drive at rest is ``held``: the gear
        then holds the wheels, with more than the motor.
        """
        self._control(speeds, self._holding if held else self._torque)

    def release(self) -> None:
        """Let the wheels roll freely."""
        self._control((0.0, 0.0), 0.0)

    def _control(self, speeds: tuple[float, float], torque: float) -> None:
        if (speeds, torque) == self._last_target:
            return  # PyBullet keeps the target of a motor until it gets another
        self._last_target = (speeds, torque)
        pybullet.setJointMotorControlArray(
            self._unit.body,
            self._unit.wheels,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=speeds,
            velocityGains=_GAINS,
            forces=(torque, torque),
            physicsClientId=self._client,
        )
