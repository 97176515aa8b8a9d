"""The result of a trial and of each step of its plan: the outcome, and belief next to truth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from msrr_bullet.trial.versions import package_versions
from msrr_scenes.errors import MsrrError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import Perception, Plant

#: Belief of the robot about a step when it ended.
Belief = Literal["docked", "undocked", "gave_up", "undecided"]

Distance = Annotated[float, Field(ge=0.0)]


class ResultError(MsrrError):
    """A text is not a trial result of this version."""


class _Record(BaseModel):
    """A frozen record without NaN or unknown keys, so that a stored record is read back as it was written."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class PlanarPose(_Record):
    """A pose in the plane, in metres and radians."""

    x_m: float
    y_m: float
    yaw_rad: float

    @classmethod
    def of(cls, pose: SE2) -> PlanarPose:
        """Return the record of a pose."""
        return cls(x_m=pose.x, y_m=pose.y, yaw_rad=pose.yaw)

    @property
    def se2(self) -> SE2:
        """The pose as an :class:`SE2`."""
        return SE2(self.x_m, self.y_m, self.yaw_rad)


class Contact(_Record):
    """The true state at the first contact of a pin with the target.

    Attributes:
        time_s: Simulated time [s].
        lateral_m: Distance of the docking port from the axis of the dock frame D [m].
        yaw_rad: Angle between the docking port and the axis of D, not negative [rad].
        estimate_error: Estimate minus truth of the unit in D; None without an estimate.
    """

    time_s: Distance
    lateral_m: Distance
    yaw_rad: Distance
    estimate_error: PlanarPose | None = None


class Seating(_Record):
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


class AttemptRecord(_Record):
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


class AssemblyFigures(_Record):
    """The figures of Zheng et al. for the long-distance phase; see :mod:`msrr_control.studies.metrics`.

    Attributes:
        tracking_error_m: Steady tracking error at the end of the arc [m]; None without a finished arc.
        amplitude_m: Largest distance from the desired point while passing an obstacle [m]; None when no
            obstacle was passed.
        recovery_s: Time from the peak until the distance stays below 5 cm [s]; None when no obstacle was
            passed.
    """

    tracking_error_m: Distance | None = None
    amplitude_m: Distance | None = None
    recovery_s: Distance | None = None


class StepResult(_Record):
    """The result of one step of the plan. All values are true values but the beliefs.

    Attributes:
        index: Index of the step in the plan.
        unit: Name of the docking unit.
        port: Active port of the docking unit.
        target: Port that is docked to, written ``<unit>.<port>``.
        outcome: Verdict of the judge.
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
    """

    index: int = Field(ge=0)
    unit: str
    port: str
    target: str
    outcome: Outcome
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

    @property
    def docked(self) -> bool:
        """Whether the unit was seated and locked, passed the pull test, and believed so."""
        return self.outcome is Outcome.DOCKED

    @property
    def succeeded(self) -> bool:
        """Whether the unit has docked, or undocked where that was the task."""
        return self.outcome in (Outcome.DOCKED, Outcome.UNDOCKED)

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


class MissionFigures(_Record):
    """The figures of a mission that a base station led.

    Attributes:
        reason: Why the mission ended.
        makespan_s: Time of the last lock [s]; None if nobody docked.
        way_m: Way that each unit has driven [m].
        parallel_share: Share of the time with any motion in which two units or more moved.
        messages_sent: Number of messages sent over the radio.
        messages_lost: Number of messages lost.
        replans: Number of routes that were planned because an earlier one could not be driven to its end.
        done: Names of the tasks that are done.
        given_up: Names of the tasks that were given up.
        clearances_m: Smallest clearance [m] of each pair ``<body>-<body>`` that was the nearest one at some
            instant.
    """

    reason: str
    makespan_s: Distance | None
    way_m: dict[str, Distance]
    parallel_share: Annotated[float, Field(ge=0.0, le=1.0)]
    messages_sent: int
    messages_lost: int
    replans: int
    done: tuple[str, ...]
    given_up: tuple[str, ...]
    clearances_m: dict[str, float]

    @property
    def total_way_m(self) -> float:
        """Way that all units have driven together [m]."""
        return sum(self.way_m.values())


def decisive_step(steps: Sequence[StepResult]) -> StepResult:
    """Return the first step to end without success; the last one if all have succeeded.

    A step that was aborted decides nothing, for it ended because of another one.
    """
    failed = [step for step in steps if not step.succeeded]
    decisive = [step for step in failed if step.outcome is not Outcome.ABORTED] or failed
    return min(decisive, key=lambda step: step.ended_s, default=steps[-1])


class TrialResult(_Record):
    """The result of one trial, in SI units and radians.

    Attributes:
        scene: Name of the scene.
        scene_hash: :func:`msrr_scenes.loading.load.scene_hash` of the scene as it was run, overrides
            included.
        seed: Seed of all random streams.
        plant: Kind of the plant.
        perception: Kind of the perception.
        versions: Installed versions, from :func:`package_versions`.
        outcome: Verdict of the judge on the whole plan.
        duration_s: Simulated time [s].
        start_redraws: Number of start poses discarded because the target was outside the outer cone.
        steps: Result of every step that began, in the order of the plan, or in which a base station began
            them.
        mission: Figures of the mission; None without a base station.
    """

    scene: str
    scene_hash: str
    seed: int
    plant: Plant
    perception: Perception
    versions: dict[str, str] = Field(default_factory=package_versions)
    outcome: Outcome
    duration_s: Distance
    start_redraws: int = Field(default=0, ge=0)
    steps: tuple[StepResult, ...]
    mission: MissionFigures | None = None

    @property
    def docked(self) -> bool:
        """Whether all was done: every step of the plan docked, or the mission is complete."""
        return self.outcome in (Outcome.DOCKED, Outcome.COMPLETE)

    @property
    def decisive_step(self) -> StepResult | None:
        """The step that decides the outcome, as :func:`decisive_step` finds it; None if none began."""
        return decisive_step(self.steps) if self.steps else None

    @property
    def reason(self) -> str:
        """Why the trial ended so: reason of the mission, else of the robot in the decisive step."""
        if self.mission is not None:
            return self.mission.reason
        return "" if self.decisive_step is None else self.decisive_step.belief_reason

    @property
    def min_clearance_m(self) -> float | None:
        """Smallest clearance of all steps and of the mission [m]; None without one."""
        found = [s.min_clearance_m for s in self.steps if s.min_clearance_m is not None]
        found += self.mission.clearances_m.values() if self.mission is not None else ()
        return min(found, default=None)

    def to_json(self) -> str:
        """Return the result as indented JSON; :meth:`from_json` reads it back."""
        return self.model_dump_json(indent=2) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Return the result that :meth:`to_json` wrote.

        Raises:
            ResultError: The text is not a result as this version writes it.
        """
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            raise ResultError(_mismatch(text, error)) from None


def _mismatch(text: str, error: ValidationError) -> str:
    """Return why a text is not a result, and which version wrote it if it says so."""
    first = error.errors()[0]
    place = ".".join(str(part) for part in first["loc"])
    message = f"not a trial result of this version: {f'{place}: ' if place else ''}{first['msg']}"
    try:
        written_by = json.loads(text)["versions"]["msrr-bullet"]
    except (ValueError, KeyError, TypeError):  # no result of any version
        return message
    return f"{message}; msrr-bullet {written_by} wrote it, run the trial again"
