"""The result of a trial: the outcome, and the results of its steps and of its mission."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, ValidationError

from msrr_bullet.trial.step_result import Distance, Record, StepResult
from msrr_bullet.trial.verdict import decisive_step
from msrr_bullet.trial.versions import trial_versions
from msrr_scenes.errors import MsrrError
from msrr_scenes.html import html_table
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.control import Perception, Plant


class ResultError(MsrrError):
    """A text is not a trial result of this version."""


class MissionFigures(Record):
    """The figures of a mission that a base station led.

    Attributes:
        makespan_s: Time of the last lock [s]; None if nobody docked.
        way_m: Way that each unit has driven [m]; below 0.01 m/s and 0.05 rad/s it counts as standing.
        parallel_share: Share of the time with any motion in which two units or more moved.
        messages_sent: Number of messages sent over the radio.
        messages_lost: Number of messages lost.
        replans: Number of routes that were planned because an earlier one could not be driven to its end.
        done: Names of the tasks that are done.
        given_up: Names of the tasks that were given up.
        min_clearance_m: Smallest clearance of any pair of bodies, those left out that were docking or locked
            [m]; None when there was none.
        nearest_pair: That pair, ``<body>-<body>``; empty when there was none.
    """

    makespan_s: Distance | None
    way_m: dict[str, Distance]
    parallel_share: Annotated[float, Field(ge=0.0, le=1.0)]
    messages_sent: int
    messages_lost: int
    replans: int
    done: tuple[str, ...]
    given_up: tuple[str, ...]
    min_clearance_m: float | None = None
    nearest_pair: str = ""

    @property
    def total_way_m(self) -> float:
        """Way that all units have driven together [m]."""
        return sum(self.way_m.values())


class TrialResult(Record):
    """The result of one trial, in SI units and radians.

    Attributes:
        scene: Name of the scene.
        scene_hash: :func:`msrr_scenes.loading.load.scene_hash` of the scene as it was run, overrides
            included.
        seed: Seed of all random streams.
        plant: Kind of the plant.
        perception: Kind of the perception.
        as_built: Grade of the workmanship, with the quantities that are not as the grade has them.
        versions: Installed versions, from :func:`trial_versions`.
        outcome: Verdict of the judge on the trial as a whole.
        reason: Why the trial ended so, in words of the judge, the base station or the robot.
        duration_s: Simulated time [s].
        start_redraws: Number of start poses discarded because the target was outside the outer cone.
        steps: Result of every step that began, in the order of the plan, or in which a base station began
            them.
        mission: Figures of the mission; None without a base station.
        folder: Run folder, if the trial was run into one; not stored.
    """

    scene: str
    scene_hash: str
    seed: int
    plant: Plant
    perception: Perception
    as_built: str = "perfect"
    versions: dict[str, str] = Field(default_factory=trial_versions)
    outcome: Outcome
    reason: str
    duration_s: Distance
    start_redraws: int = Field(default=0, ge=0)
    steps: tuple[StepResult, ...]
    mission: MissionFigures | None = None
    folder: Path | None = Field(default=None, exclude=True, repr=False)

    def __eq__(self, other: object) -> bool:
        """Return whether the other result says the same; where the runs are stored does not count."""
        return isinstance(other, TrialResult) and self.model_dump() == other.model_dump()

    __hash__ = Record.__hash__

    def _repr_html_(self) -> str:
        """Return the result as a notebook shows it: a table, and picture and page of the run."""
        rows = [
            (
                step.task,
                step.belief.replace("_", " "),
                step.outcome.value,
                f"{1e3 * step.contact.lateral_m:z.2f} mm" if step.contact else "",
                f"{step.ended_s:.2f} s",
            )
            for step in self.steps
        ]
        head = ("step", "belief", "truth", "lateral at contact", "end")
        table = html_table(f"{self.title}: {self.outcome.value} ({self.reason})", rows, head)
        if self.folder is None:
            return table
        from msrr_bullet.run_folder import run_html  # it loads the log and with it OpenCV, which few need

        return table + run_html(self.folder)

    @property
    def title(self) -> str:
        """Which trial it was, in words."""
        return f"{self.scene}, seed {self.seed} ({self.plant}, {self.perception}, {self.as_built})"

    @property
    def docked(self) -> bool:
        """Whether all was done: every step of the plan docked, or the mission is complete."""
        return self.outcome in (Outcome.DOCKED, Outcome.COMPLETE)

    @property
    def decisive_step(self) -> StepResult | None:
        """The first step to end without success, else the last one; None if none began.

        See :func:`msrr_bullet.trial.verdict.decisive_step`.
        """
        return decisive_step(self.steps) if self.steps else None

    @property
    def min_clearance_m(self) -> float | None:
        """Smallest clearance of all steps and of the mission [m]; None without one."""
        parts = (*self.steps, *(() if self.mission is None else (self.mission,)))
        return min((p.min_clearance_m for p in parts if p.min_clearance_m is not None), default=None)

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
    except (ValueError, KeyError, TypeError, RecursionError):  # no result of any version
        return message
    return f"{message}; msrr-bullet {written_by} wrote it, run the trial again"
