"""Specifications of a unit's drive, command link and lock."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import model_validator

from msrr_scenes.specs.spec import (
    Duration,
    Force,
    Latency,
    Probability,
    Spec,
    Speed,
    Torque,
    TurnRate,
    between,
)

_LIMITS = ("v_max_mps", "v_close_mps", "a_max_mps2", "w_max_radps", "dw_max_radps2", "kappa_per_s")

#: Limit of an acceleration [m/s^2 or rad/s^2]; a million is a drive without one.
AccelerationLimit = Annotated[float, between(1e-3, 1e6)]

#: Limits of the two settings under which the laws were studied.
LIMIT_SETTINGS: dict[str, dict[str, float]] = {
    "normal": dict(zip(_LIMITS, (0.4, 0.3, 0.5, 1.5, 5.0, 15.0), strict=True)),
    "tight": dict(zip(_LIMITS, (0.35, 0.3, 0.3, 1.0, 2.0, 8.0), strict=True)),
}


class LimitsSpec(Spec):
    """Magnitude and rate limits of the drive and the bandwidth of its nested loop (Zheng et al., eq. 3)."""

    setting: Literal["normal", "tight"] = "normal"
    """Named set of limits that fills in every limit that is not given."""
    v_max_mps: Speed
    """Largest forward speed far from the port [m/s]."""
    v_close_mps: Speed
    """Largest forward speed in front of the port [m/s]."""
    a_max_mps2: AccelerationLimit
    """Largest forward acceleration [m/s^2]."""
    w_max_radps: TurnRate
    """Largest yaw rate [rad/s]."""
    dw_max_radps2: AccelerationLimit
    """Largest yaw acceleration [rad/s^2]."""
    kappa_per_s: Annotated[float, between(0.01, 1e6)]
    """Bandwidth kappa of the nested loop [1/s]; above the rate of the physics there is no lag."""

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: Any) -> Any:
        if isinstance(data, dict):
            # An unknown setting is refused as such, not by every value that it leaves open.
            values = LIMIT_SETTINGS.get(str(data.get("setting", "normal")), LIMIT_SETTINGS["normal"])
            return {**values, **data}
        return data


class LinkSpec(Spec):
    """The command link to the wheels and to the lock."""

    latency_ms: Latency = 0.0
    """Delay of a command [ms]."""
    loss: Probability = 0.0
    """Probability that a command is lost; the last one then stays in force."""


class LockSpec(Spec):
    """The lock of the docking port, and the pull test with which the judge checks it."""

    strength_n: Force = 60.0
    """Force at which the closed lock gives way [N]."""
    close_time_s: Duration = 0.5
    """Time that the lock takes to close [s]."""
    pull_force_n: Force = 25.0
    """Force of the pull test along the docking axis [N]."""
    pull_time_s: Annotated[float, between(1e-3, 60.0)] = 0.5
    """Duration of the pull test [s]; a lock that creeps shows it within a minute."""


class WheelMotorSpec(Spec):
    """The wheel motors.

    A unit must not be able to push another one across the floor: at 0.15 N m both wheels of the shipped unit
    push with 9 N, three quarters of what a standing one resists.
    """

    torque_nm: Torque = 0.15
    """Largest torque on each wheel while driving [N m]."""
    holding_torque_nm: Torque = 1.0
    """Torque with which the gear holds a wheel that is commanded to stand still [N m]."""
