"""Specifications of what is to be done: who docks to whom, by which law, with how many tries."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from msrr_scenes.specs.spec import Choice, Name, NonNegative, Positive, Spec


class DockStep(Spec):
    """One step of the plan: ``unit`` docks its active ``port`` to ``to`` (written ``<unit>.<port>``)."""

    unit: Name
    port: Name = "front"
    to: str = Field(pattern=r"^[a-z][a-z0-9_]*\.[a-z][a-z0-9_]*$")

    @property
    def target_unit(self) -> str:
        """The unit docked to."""
        return self.to.partition(".")[0]

    @property
    def target_port(self) -> str:
        """The port docked to."""
        return self.to.partition(".")[2]


class VerifySpec(Spec):
    """How the robot convinces itself that it is docked, beyond the lock's own feedback.

    Attributes:
        by_sight: Compare the pose seen in the image with that of a seated unit.
        position_m: Largest deviation accepted.
        yaw_deg: Largest deviation accepted.
        time_s: How long it looks at most.
    """

    by_sight: bool = True
    position_m: Positive = 0.003
    yaw_deg: Positive = 1.5
    time_s: Positive = 1.5


class DockingSpec(Spec):
    """Parameters of the phase machine.

    Attributes:
        attempts: How often docking is tried before the robot gives up.
        search_time_s: How long the marker may stay unseen before hand-over fails.
        lost_time_s: How long the target may be lost while docking before the robot retreats.
        stall_time_s: How long the robot presses against the port without seating before it retreats.
        retreat_m: Distance to the target face from which the next attempt starts.
        press_mps: Speed with which it presses into the port.
    """

    attempts: int = Field(default=3, ge=1, le=20)
    search_time_s: Positive = 4.0
    lost_time_s: Positive = 0.6
    stall_time_s: Positive = 2.0
    retreat_m: Positive = 0.45
    press_mps: Positive = 0.05
    verify: VerifySpec = VerifySpec()


class JudgeSpec(Spec):
    """What the judge asks of a trial, from truth."""

    min_clearance_m: NonNegative = 0.02
    seated_depth_m: Positive = Field(default=0.003, description="largest gap between the faces when seated")


class GuardSpec(Spec):
    """The guard that limits what the law commands by the clearance it would leave.

    Its distances lie below what the laws keep by themselves, so that it does not hold up a healthy run.

    Attributes:
        enabled: Off, every command passes.
        slow_m: Clearance ahead below which it slows the unit.
        stop_m: Clearance ahead that it does not let the unit fall below.
        sigmas: How many standard deviations of the estimated distance it takes off every clearance.
    """

    enabled: bool = True
    slow_m: Positive = 0.05
    stop_m: Positive = 0.03
    sigmas: NonNegative = 2.0

    @model_validator(mode="after")
    def _in_order(self) -> GuardSpec:
        if self.stop_m >= self.slow_m:
            raise ValueError(
                f"slow_m has to be larger than stop_m, found {self.slow_m:g} and {self.stop_m:g}"
            )
        return self


class ControlSpec(Spec):
    """Laws and estimator by name, with their parameters."""

    rate_hz: Positive = 50.0
    assembly: Choice = Choice(name="c1")
    docking: Choice = Choice(name="cbf")
    estimator: Choice = Choice(name="corner_ekf")
    detector: Choice = Choice(name="pupil")
    delay_compensation: bool = True
    guard: GuardSpec = GuardSpec()


Plant = Literal["bullet", "unicycle"]
Perception = Literal["images", "parametric"]
