"""Specifications of the task: who docks to whom, by which laws, within which bounds, judged by what."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from msrr_scenes.specs.bodies import MAX_UNITS
from msrr_scenes.specs.spec import (
    Choice,
    Distance,
    Duration,
    Length,
    Name,
    PortName,
    PoseSpec,
    Rate,
    Spec,
    Speed,
    Tolerance,
    between,
)

Plant = Literal["bullet", "unicycle"]
Perception = Literal["images", "parametric"]

#: Angle of a cone [deg], less than a right angle on either side: a camera sees no more.
ConeAngle = Annotated[float, between(0.1, 89.0)]


#: Names of earlier steps; None stands for the step before.
After = Annotated[tuple[Name, ...], Field(max_length=MAX_UNITS)] | None


class DockStep(Spec):
    """One step of the plan: a unit docks to a port of another one."""

    unit: Name
    """Unit that docks."""
    port: Name = "front"
    """Active port of the docking unit."""
    to: PortName
    """Port that is docked to, written ``<unit>.<port>``."""
    calibrate: bool = False
    """Whether the unit first calibrates its camera and wheels by a drive in front of the port."""
    name: Name | None = None
    """Name of the step, for ``after``; by default that of the unit."""
    after: After = None
    """Names of the steps that have to be done before this one begins; by default the step before it in the
    plan. Steps that do not come after one another are carried out at the same time, which needs a base
    station."""

    @property
    def label(self) -> str:
        """Name by which other steps refer to this one."""
        return self.name or self.unit

    def __str__(self) -> str:
        """Return the step in words."""
        return f"{self.unit}.{self.port} to {self.to}"

    @property
    def target_unit(self) -> str:
        """Unit that is docked to."""
        return self.to.partition(".")[0]

    @property
    def target_port(self) -> str:
        """Name of the port that is docked to, without its unit."""
        return self.to.partition(".")[2]


class UndockStep(Spec):
    """A step in which a unit opens its lock and backs out of the port."""

    undock: Name
    """Unit that undocks."""
    name: Name | None = None
    """Name of the step, for ``after``; by default that of the unit."""
    after: After = None
    """Names of the steps that have to be done before this one begins; by default the step before it in the
    plan."""

    def __str__(self) -> str:
        """Return the step in words."""
        return f"{self.undock} undocks"

    @property
    def unit(self) -> str:
        """Unit that undocks."""
        return self.undock

    @property
    def label(self) -> str:
        """Name by which other steps refer to this one."""
        return self.name or self.undock


class MoveStep(Spec):
    """A step in which a unit drives to a pose."""

    move: Name
    """Unit that drives."""
    pose: PoseSpec = PoseSpec()
    """Pose of the axle where the unit is to stand, in the world frame."""
    name: Name | None = None
    """Name of the step, for ``after``; by default that of the unit."""
    after: After = None
    """Names of the steps that have to be done before this one begins; by default the step before it in the
    plan."""

    def __str__(self) -> str:
        """Return the step in words."""
        return f"{self.move} drives to ({self.pose.x_m:g}, {self.pose.y_m:g})"

    @property
    def unit(self) -> str:
        """Unit that drives."""
        return self.move

    @property
    def label(self) -> str:
        """Name by which other steps refer to this one."""
        return self.name or self.move


def _kind(step: Any) -> str:
    """Return the kind of a step as written: by the key that only steps of that kind have."""
    keys = step if isinstance(step, dict) else getattr(type(step), "model_fields", ())
    return next((kind for kind in ("undock", "move") if kind in keys), "dock")


PlanStep = Annotated[
    Annotated[DockStep, Tag("dock")]
    | Annotated[UndockStep, Tag("undock")]
    | Annotated[MoveStep, Tag("move")],
    Discriminator(_kind),
]


def predecessors(plan: Sequence[PlanStep]) -> tuple[tuple[int, ...], ...]:
    """Return for every step the indices of the steps that it comes directly after.

    Two steps of one unit keep the order of the plan, whether they say so or not. Names that no step has are
    left out, and a name that several steps have means all of them; the checks of a scene refuse both.
    """
    found: list[tuple[int, ...]] = []
    for index, step in enumerate(plan):
        if step.after is None:
            named = [index - 1] if index else []
        else:
            named = [i for i, other in enumerate(plan) if other.label in step.after]
        own = [i for i, other in enumerate(plan[:index]) if other.unit == step.unit]
        found.append(tuple(dict.fromkeys([*named, *own[-1:]])))
    return tuple(found)


def steps_of_target(plan: Sequence[PlanStep], index: int) -> tuple[int, ...]:
    """Return the steps behind which a docking begins although it names none of them.

    They are the steps of the unit that is docked to which neither come before the docking nor after it: a
    unit to which another one is docked does not drive.
    """
    step = plan[index]
    if not isinstance(step, DockStep):
        return ()
    before = ancestors(plan, index)
    return tuple(
        i
        for i, other in enumerate(plan)
        if other.unit == step.target_unit and i not in before and index not in ancestors(plan, i)
    )


def ancestors(plan: Sequence[PlanStep], index: int) -> tuple[int, ...]:
    """Return the indices of all steps that are done before a step begins, in order."""
    before, pending = set[int](), [index]
    direct = predecessors(plan)
    while pending:
        new = [i for i in direct[pending.pop()] if i not in before]
        before.update(new)
        pending += new
    return tuple(sorted(before))


def in_order(plan: Sequence[PlanStep]) -> list[int]:
    """Return the indices of all steps, each after those that it comes after, else as in the plan."""
    return sorted(range(len(plan)), key=lambda index: (len(ancestors(plan, index)), index))


class LosSpec(Spec):
    """Line-of-sight target and cone of the close-range phase (Zheng et al., eqs. 21-22).

    The target is the pair of points (setback, +-half_width) in the dock frame D: the outer black edges of the
    marker's side tags.
    """

    half_width_m: Length = 0.0441
    """Half the distance b between the two edges of the target [m]."""
    setback_m: Distance = 0.0442
    """Distance s_b of the target's edges behind the face of the port [m]."""
    inner_deg: ConeAngle = 20.0
    """Angle th_in of the line of sight at which the correction starts [deg]."""
    outer_deg: ConeAngle = 30.0
    """Angle th_out of the line of sight at which the correction is largest [deg]."""

    @property
    def inner(self) -> float:
        """Angle th_in [rad]."""
        return math.radians(self.inner_deg)

    @property
    def outer(self) -> float:
        """Angle th_out [rad]."""
        return math.radians(self.outer_deg)

    def angle_at_contact(self, camera_to_face: float) -> float:
        """Return the edge angle [rad] of an aligned unit, its camera ``camera_to_face`` [m] off the face."""
        return math.atan2(self.half_width_m, camera_to_face + self.setback_m)


class VerifySpec(Spec):
    """Checks by which the robot convinces itself that it is docked, beyond the lock's own feedback."""

    by_sight: bool = True
    """Whether the pose seen in the image is compared with that of a seated unit."""
    position_m: Length = 0.003
    """Largest accepted deviation of the position [m]."""
    yaw_deg: Tolerance = 1.5
    """Largest accepted deviation of the yaw [deg]."""
    time_s: Duration = 1.5
    """Longest time that the check may take [s]."""


class DockingSpec(Spec):
    """Parameters of the phase machine."""

    attempts: int = Field(default=3, ge=1, le=20)
    """Number of attempts before the robot gives up."""
    search_time_s: Duration = 7.0
    """How long the marker may stay unseen before hand-over fails [s]."""
    lost_time_s: Duration = 0.6
    """How long the target may be lost while docking before the robot retreats [s]."""
    stall_time_s: Duration = 2.0
    """How long the robot may make no progress towards its seat before it retreats [s]."""
    retreat_m: Length = 0.45
    """Distance to the target face from which the next attempt starts [m]."""
    press_mps: Speed = 0.05
    """Speed with which the robot presses into the port [m/s]."""
    learn_seats: bool = True
    """Whether a docked unit learns how the port looks from its seat, for its next dock there."""
    verify: VerifySpec = VerifySpec()
    """Check of the finished docking."""


class JudgeSpec(Spec):
    """Criteria by which the judge decides the outcome of a trial, from truth."""

    min_clearance_m: Distance = 0.02
    """Smallest distance allowed between bodies other than the docking pair [m]."""
    seated_depth_m: Length = 0.003
    """Largest gap between the two faces of a seated unit, at the height of the pins [m]."""


class GuardSpec(Spec):
    """The collision monitor, which limits commands by the clearance that they would leave.

    Its distances lie below those that the laws keep, so that it does not hold up a healthy run.
    """

    enabled: bool = True
    """Whether commands are limited at all."""
    slow_m: Length = 0.05
    """Clearance ahead below which the unit is slowed [m]."""
    stop_m: Length = 0.03
    """Clearance ahead below which the unit must not come [m]."""
    sigmas: Annotated[float, between(0.0, 10.0)] = 2.0
    """Number of standard deviations of the estimated distance that is subtracted from every clearance.

    Ten are never exceeded by a Gaussian error.
    """

    @model_validator(mode="after")
    def _in_order(self) -> GuardSpec:
        if self.stop_m >= self.slow_m:
            raise ValueError(
                f"slow_m has to be larger than stop_m, found {self.slow_m:g} and {self.stop_m:g}"
            )
        return self


class ControlSpec(Spec):
    """The robot's software: laws, estimator and detector by name, with their parameters."""

    rate_hz: Rate = 50.0
    """Control instants per second [Hz]."""
    assembly: Choice = Choice(name="c1")
    """Law of the long-distance phase."""
    docking: Choice = Choice(name="cbf")
    """Law of the close-range phase."""
    estimator: Choice = Choice(name="corner_ekf")
    """Estimator of the pose relative to the target."""
    detector: Choice = Choice(name="pupil")
    """Detector of tags in images."""
    delay_compensation: bool = True
    """Whether the estimate is moved from the last exposure up to the control instant."""
    drive_feed_forward: bool = True
    """Whether commands make up for the errors of wheel radii and track that the estimator has found out."""
    guard: GuardSpec = GuardSpec()
    """Collision monitor."""
