"""The result of one step of a trial: the outcome, and belief next to truth."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ExposureCounts, Phase
from msrr_scenes.outcome import Outcome

#: Belief of the robot about a step when it ended.
Belief = Literal["docked", "undocked", "gave_up", "undecided"]

Distance = Annotated[float, Field(ge=0.0)]


class Record(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A frozen record without NaN or unknown keys, so that a stored record is read back as it was written."""


class PlanarPose(Record):
    """A pose in the plane.

    Attributes:
        x_m: First coordinate of the position [m].
        y_m: Second coordinate of the position [m].
        yaw_rad: Angle from the x axis of the frame, counter-clockwise [rad].
    """

    x_m: float
    y_m: float
    yaw_rad: float

    @classmethod
    def of(cls, pose: SE2) -> PlanarPose:
        """Return the record of a pose."""
        return cls(x_m=pose.x, y_m=pose.y, yaw_rad=pose.yaw)


class Contact(Record):
    """The true state at the first contact of a pin with the target.

    Attributes:
        time_s: Simulated time [s].
        lateral_m: Distance of the docking port from the axis of the dock frame D [m].
        yaw_rad: Angle between the docking port and the axis of D, not negative [rad].
        port: Pose of the docking port in D at the height of the pins: the same errors with their signs.
        estimate_error: Estimate minus truth of the pose of the axle in D; None without an estimate.
    """

    time_s: Distance
    lateral_m: Distance
    yaw_rad: Distance
    port: PlanarPose
    estimate_error: PlanarPose | None = None


class Seating(Record):
    """The true relative pose of the pair at the end, before the pull test, at the height of the pins.

    Attributes:
        axial_gap_m: Distance between the faces along the axis of D [m], slightly negative under pressure.
        lateral_m: Distance of the docking port from the axis of the dock frame D [m].
        yaw_rad: Angle between the docking port and the axis of D, not negative [rad].
        seated: Whether the judge counts the unit as seated.
    """

    axial_gap_m: float
    lateral_m: Distance
    yaw_rad: Distance
    seated: bool


class AttemptRecord(Record):
    """One attempt of a step.

    Attributes:
        ended_s: Simulated time of the last decision [s].
        phase: Phase at the end.
        reason: Reason of the robot for the end.
        contact: First pin contact; None without contact.
        believed: Estimate X_DU at the end; None without an estimate.
        true: True X_DU at the end.
    """

    ended_s: Distance
    phase: Phase
    reason: str
    contact: Contact | None = None
    believed: PlanarPose | None
    true: PlanarPose


class AssemblyFigures(Record):
    """The figures of Zheng et al. for the long-distance phase; see :mod:`msrr_control.studies.metrics`.

    Attributes:
        tracking_error_m: Steady tracking error at the end of the arc [m]; None without a finished arc.
        amplitude_m: Largest distance from the desired point while passing an obstacle [m]; None when no
            obstacle was passed.
        recovery_s: Time from the peak until the distance stays below 5 cm [s]; None when no obstacle was
            passed, or the trial ended before that.
    """

    tracking_error_m: Distance | None = None
    amplitude_m: Distance | None = None
    recovery_s: Distance | None = None


class StepResult(Record):
    """The result of one step of the plan. All values are true values but the beliefs.

    Attributes:
        index: Index of the step in the plan.
        unit: Name of the docking unit.
        port: Active port of the docking unit.
        target: Port that is docked to, written ``<unit>.<port>``.
        outcome: Verdict of the judge.
        verdict_reason: Why the judge ended the step, or why the unit has not docked though it believes so;
            else empty.
        belief: Belief of the robot.
        belief_reason: Reason of the robot for the belief.
        started_s: Simulated time of the start [s].
        attempts: Every attempt, in order; the last one tells how the step ended.
        seating: True relative pose of the pair at the end; None when the port was not reached.
        lock_closed: Whether the lock reports that it is closed.
        lock_engaged: Whether the lock holds the other unit; a lock that closed on nothing does not.
        pull_test_passed: Whether the lock held the pull; None without a pull test.
        min_clearance_m: Smallest clearance of any pair of bodies, those left out that were docking or locked
            together [m]; 0 or negative after a collision, None without such a pair.
        assembly: Figures of the long-distance phase; None without one.
        undocks: Whether the task was to undock.
        onboard_exposures: What became of the exposures of the unit's own camera; None where its estimator
            counts none.
        overhead_exposures: What became of those of the overhead camera that show the unit; None where there
            are none.
    """

    index: int = Field(ge=0)
    unit: str
    port: str
    target: str
    outcome: Outcome
    verdict_reason: str = ""
    belief: Belief
    belief_reason: str
    started_s: Distance
    attempts: tuple[AttemptRecord, ...] = Field(min_length=1)
    seating: Seating | None = None
    lock_closed: bool = False
    lock_engaged: bool = False
    pull_test_passed: bool | None = None
    min_clearance_m: float | None = None
    assembly: AssemblyFigures | None = None
    undocks: bool = False
    onboard_exposures: ExposureCounts | None = None
    overhead_exposures: ExposureCounts | None = None

    @property
    def task(self) -> str:
        """What the unit was to do, such as ``a to b.rear``; with ``from`` where it was to undock."""
        return f"{self.unit} {'from' if self.undocks else 'to'} {self.target}"

    @property
    def docked(self) -> bool:
        """Whether the unit was seated and locked, passed the pull test, and believed so."""
        return self.outcome is Outcome.DOCKED

    @property
    def succeeded(self) -> bool:
        """Whether the unit has docked, or undocked where that was the task."""
        return self.outcome in (Outcome.DOCKED, Outcome.UNDOCKED)

    @property
    def reason(self) -> str:
        """Why the step ended so: reason of the judge, else of the robot."""
        return self.verdict_reason or self.belief_reason

    @property
    def phase(self) -> Phase:
        """Phase at the end."""
        return self.attempts[-1].phase

    @property
    def contact(self) -> Contact | None:
        """First pin contact of the last attempt; None without contact."""
        return self.attempts[-1].contact

    @property
    def ended_s(self) -> float:
        """Simulated time of the last decision [s]."""
        return self.attempts[-1].ended_s
