"""Specifications of the robot's software: by which laws, within which bounds, judged by what."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.spec import Choice, Distance, Duration, Length, Rate, Spec, Speed, Tolerance, between

Plant = Literal["bullet", "unicycle"]
Perception = Literal["images", "parametric"]

#: Angle of a cone [deg], less than a right angle on either side: a camera sees no more.
ConeAngle = Annotated[float, between(0.1, 89.0)]


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

    def edge_bearings(self, X_DC: SE2) -> tuple[float, float]:
        """Return the angles from the optical axis to the left and the right edge, to the left positive [rad].

        Args:
            X_DC: Pose of the camera in the dock frame; x of C is the optical axis.
        """
        edges = [[self.setback_m, self.half_width_m], [self.setback_m, -self.half_width_m]]
        left, right = X_DC.inverse().act(edges).tolist()
        return math.atan2(left[1], left[0]), math.atan2(right[1], right[0])

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
    tug_m: Distance = 0.03
    """Way of the wheels in a tug test [m]; 0 for no tug test. A unit that is seen to move by a third of it is
    not held; backlash of the drive takes up some of the way."""


class DockingSpec(Spec):
    """Parameters of the phase machine."""

    attempts: int = Field(default=3, ge=1, le=20)
    """Number of approaches to the port before the robot gives up, and of searches for the marker in a row."""
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
    """Whether a docked unit learns how the port looks from its seat, for the way out and the next dock."""
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
    overhead_correction: bool = True
    """Whether the overhead camera corrects what a unit's own camera tells on the way to the port and back."""
    guard: GuardSpec = GuardSpec()
    """Collision monitor."""

    @model_validator(mode="after")
    def _one_delay_compensation(self) -> ControlSpec:
        if "delay_compensation" in self.estimator.params:
            raise ValueError(
                "delay_compensation is a key of its own, for it holds for every estimator: set "
                "control.delay_compensation, and take it out of the params of the estimator"
            )
        return self
