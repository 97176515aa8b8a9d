"""What a trial leaves behind: the verdict, and belief beside truth."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import Perception, Plant

#: What the robot itself made of the trial when it ended.
Belief = Literal["docked", "gave_up", "undecided"]

Distance = Annotated[float, Field(ge=0.0)]

#: Distributions whose version can change a bit of a trial.
_DISTRIBUTIONS = (
    "msrr-bullet",
    "pybullet",
    "numpy",
    "scipy",
    "opencv-python-headless",
    "pupil-apriltags",
    "python-fcl",
    "numba",
)


@lru_cache(maxsize=1)
def _installed() -> tuple[tuple[str, str], ...]:
    found = [("python", platform.python_version())]
    for name in _DISTRIBUTIONS:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:
            continue  # an optional one: its absence is part of the answer
    return tuple(found)


def package_versions() -> dict[str, str]:
    """Return the versions of Python and of every installed package that can change a trial."""
    return dict(_installed())


class _Record(BaseModel):
    """A frozen record; no NaN, no unknown keys, so that a stored one is read back as it was written."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class PlanarPose(_Record):
    """A pose in the plane [m, rad]."""

    x_m: float
    y_m: float
    yaw_rad: float

    @classmethod
    def of(cls, pose: SE2) -> PlanarPose:
        """Record an SE(2)."""
        return cls(x_m=pose.x, y_m=pose.y, yaw_rad=pose.yaw)

    @property
    def se2(self) -> SE2:
        """The pose as SE(2)."""
        return SE2(self.x_m, self.y_m, self.yaw_rad)


class Contact(_Record):
    """The first touch of a pin and the port, from truth.

    Attributes:
        time_s: Simulated time.
        lateral_m: Distance of the front port from the axis of the dock frame D.
        yaw_rad: Angle between the unit's heading and that axis, not negative.
        estimate_error: Estimate minus truth of the unit in D at that instant; None without an estimate.
    """

    time_s: Distance
    lateral_m: Distance
    yaw_rad: Distance
    estimate_error: PlanarPose | None = None


class Seating(_Record):
    """How the pair stood to each other at the end, before the pull test, from truth.

    Attributes:
        axial_gap_m: Gap between the faces along the docking axis; slightly negative when they press.
        lateral_m: Distance of the front port from the axis of D.
        yaw_rad: Angle to that axis, not negative.
        seated: The judge's verdict on the three.
    """

    axial_gap_m: float
    lateral_m: Distance
    yaw_rad: Distance
    seated: bool


class AttemptRecord(_Record):
    """One attempt of one step of the plan.

    Attributes:
        step: Index in the plan.
        attempt: Counted from 1.
        ended_s: Simulated time of its end.
        phase: Phase in which it ended.
        reason: Why, in the robot's words.
        believed: Estimate X_DU at its end; None when there was none.
        true: True X_DU at its end.
    """

    step: int = Field(ge=0)
    attempt: int = Field(ge=1)
    ended_s: Distance
    phase: Phase
    reason: str
    believed: PlanarPose | None
    true: PlanarPose


class AssemblyFigures(_Record):
    """The paper's figures of the long-distance phase; see :mod:`msrr_control.studies.metrics`.

    Attributes:
        tracking_error_m: Steady tracking error about the end of the arc; None when no arc was ended.
        amplitude_m: Largest distance from the desired point while passing an obstacle; None when none was
            passed.
        recovery_s: From that peak until that distance stays below 5 cm; None when none was passed.
    """

    tracking_error_m: Distance | None = None
    amplitude_m: Distance | None = None
    recovery_s: Distance | None = None


class TrialResult(_Record):
    """Verdict of one trial. SI and radians; what was measured is truth unless it says ``believed``.

    Attributes:
        scene: Name of the scene.
        scene_hash: :func:`msrr_scenes.loading.load.scene_hash` of the scene as it was run, overrides
            included.
        seed: Seed of all random streams.
        plant: What moved the units.
        perception: What the robot saw with.
        versions: Packages that ran it, see :func:`package_versions`.
        outcome: The judge's verdict.
        belief: What the robot said.
        belief_reason: Why it said so.
        attempts: Number of docking attempts begun, over all steps of the plan.
        duration_s: Simulated time.
        phase: Phase at the end.
        contact: First pin contact of the attempt that decided the trial; None without contact.
        seating: How the pair stood at the end; None when they were not near each other.
        lock_closed: The cam says that it is closed.
        lock_engaged: The lock holds the other unit (a cam that closed on nothing does not).
        pull_test_passed: None when the pull test was not made.
        min_clearance_m: Smallest distance between bodies that were not docking; None with no such pair.
        assembly: Figures of the last step's long-distance phase; None without one.
        start_redraws: Starts thrown away because the target lay outside the outer cone.
        records: One for each attempt, in order.
    """

    scene: str
    scene_hash: str
    seed: int
    plant: Plant
    perception: Perception
    versions: dict[str, str] = Field(default_factory=package_versions)
    outcome: Outcome
    belief: Belief
    belief_reason: str
    attempts: int = Field(ge=0)
    duration_s: Distance
    phase: Phase
    contact: Contact | None = None
    seating: Seating | None = None
    lock_closed: bool = False
    lock_engaged: bool = False
    pull_test_passed: bool | None = None
    min_clearance_m: float | None = None
    assembly: AssemblyFigures | None = None
    start_redraws: int = Field(default=0, ge=0)
    records: tuple[AttemptRecord, ...] = ()

    @property
    def docked(self) -> bool:
        """Seated, locked, pulled at, and believed."""
        return self.outcome is Outcome.DOCKED

    def to_json(self) -> str:
        """Return the result as indented JSON; :meth:`from_json` reads it back."""
        return self.model_dump_json(indent=2) + "\n"

    @classmethod
    def from_json(cls, text: str) -> TrialResult:
        """Read a result back.

        Raises:
            pydantic.ValidationError: The text is not a result.
        """
        return cls.model_validate_json(text)
