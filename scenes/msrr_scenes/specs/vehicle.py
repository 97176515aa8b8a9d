"""Specifications of what a unit's drive, lock and command link can do."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import model_validator

from msrr_scenes.specs.spec import NonNegative, Positive, Probability, Spec

#: Limits of the two settings under which the laws were studied.
LIMIT_SETTINGS: dict[str, dict[str, float]] = {
    "normal": {
        "v_max_mps": 0.4,
        "v_close_mps": 0.3,
        "a_max_mps2": 0.5,
        "w_max_radps": 1.5,
        "dw_max_radps2": 5.0,
        "kappa_per_s": 15.0,
    },
    "tight": {
        "v_max_mps": 0.35,
        "v_close_mps": 0.3,
        "a_max_mps2": 0.3,
        "w_max_radps": 1.0,
        "dw_max_radps2": 2.0,
        "kappa_per_s": 8.0,
    },
}


class LimitsSpec(Spec):
    """Magnitude and rate limits of the drive and the bandwidth of its nested loop (Zheng et al., eq. 3).

    ``setting`` fills in every value that is not given.
    """

    setting: Literal["normal", "tight"] = "normal"
    v_max_mps: Positive
    v_close_mps: Positive
    a_max_mps2: Positive
    w_max_radps: Positive
    dw_max_radps2: Positive
    kappa_per_s: Positive

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: Any) -> Any:
        if isinstance(data, dict):
            # An unknown setting is refused as such, not by every value that it leaves open.
            values = LIMIT_SETTINGS.get(str(data.get("setting", "normal")), LIMIT_SETTINGS["normal"])
            return {**values, **data}
        return data


class LinkSpec(Spec):
    """The command link to the wheels: delay and loss. A lost command leaves the last one in force."""

    latency_ms: NonNegative = 0.0
    loss: Probability = 0.0


class LockSpec(Spec):
    """The lock, and the force with which the judge pulls at it.

    Attributes:
        strength_n: Force at which the closed lock gives way.
        close_time_s: Time the cam takes.
        pull_force_n: Force of the pull test along the docking axis.
        pull_time_s: How long it is held.
    """

    strength_n: Positive = 60.0
    close_time_s: Positive = 0.5
    pull_force_n: Positive = 25.0
    pull_time_s: Positive = 0.5


class WheelMotorSpec(Spec):
    """The wheel motors.

    A unit must not be able to push another one across the floor: at 0.15 N m both wheels of the shipped unit
    push with 9 N, three quarters of what a standing one resists.

    Attributes:
        torque_nm: Largest torque on each wheel while driving.
        holding_torque_nm: Torque with which the gear holds a wheel that is told to stand still.
    """

    torque_nm: Positive = 0.15
    holding_torque_nm: Positive = 1.0
