"""The summary of a sweep: counts, a success rate with its interval, quantiles of steps and of missions."""

from __future__ import annotations

from pydantic import BaseModel

from msrr_bullet.statistics import Quantiles, Rate, interval_text
from msrr_scenes.html import html_table
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.control import Perception, Plant
from msrr_scenes.wording import counted


class TrialFailure(BaseModel, frozen=True):
    """A trial without a result, as the program failed and not the robot, or what was asked for cannot be.

    Attributes:
        scene: Name of the scene.
        scene_hash: Hash of the scene.
        seed: Seed of the trial.
        error: What happened.
        bad_input: Whether what was asked for is the cause, and not the program: the trial took longer on the
            wall clock than it may, or no start is found for its seed.
    """

    scene: str
    scene_hash: str
    seed: int
    error: str
    bad_input: bool = False


class Unsuccessful(BaseModel, frozen=True):
    """A trial that ended otherwise than ``docked`` or, for missions, ``complete``.

    Attributes:
        seed: Seed of the trial.
        outcome: How it ended.
        reason: Why, in words.
    """

    seed: int
    outcome: Outcome
    reason: str


class StepFigures(BaseModel, frozen=True):
    """Figures of one step over the trials that began it, or of many steps, each of which counts as a trial.

    Quantiles have intervals if every step is of another trial: those of one trial depend on each other.

    Attributes:
        trials: Number of trials that began the step.
        outcomes: Number of these trials by the outcome of the step.
        contact_lateral_mm: Lateral error at the first pin contact of the last attempt, over all that came to
            it (truth).
        contact_yaw_deg: Yaw error at that contact (truth).
        seated_axial_mm: Gap between the faces, over all that ended seated (truth).
        tracking_error_m: Tracking error of the long-distance phase, over all that completed an arc; see
            :class:`msrr_bullet.trial.result.AssemblyFigures`.
        amplitude_m: Amplitude of the long-distance phase, over all that passed an obstacle.
        recovery_s: Recovery time of the long-distance phase, over all that passed an obstacle.
        onboard_disagreeing_percent: Share of the exposures of the unit's own camera that did not agree with
            its filter, or agreed only if the wheels were doubted.
        overhead_disagreeing_percent: Share of those of the overhead camera, likewise.
        attempts: Number of attempts.
        docked_by_attempt: Number of trials in which the step docked, by the attempt that succeeded.
        min_clearance_m: Smallest clearance; None when there was no body to come near.
    """

    trials: int
    outcomes: dict[str, int]
    contact_lateral_mm: Quantiles
    contact_yaw_deg: Quantiles
    seated_axial_mm: Quantiles
    tracking_error_m: Quantiles
    amplitude_m: Quantiles
    recovery_s: Quantiles
    onboard_disagreeing_percent: Quantiles
    overhead_disagreeing_percent: Quantiles
    attempts: Quantiles
    docked_by_attempt: dict[int, int]
    min_clearance_m: float | None


class StepSummary(StepFigures):
    """Summary of one step of the plan over the trials that began it.

    Attributes:
        unit: Name of the docking unit.
        target: Port that is docked to, written ``<unit>.<port>``.
    """

    unit: str
    target: str


class MissionSummary(BaseModel, frozen=True):
    """Summary of the missions that a base station led; see :class:`msrr_bullet.trial.result.MissionFigures`.

    Attributes:
        docks: Figures of all docking steps, which differ from trial to trial.
        docks_again: Figures of those at a port where the same unit had docked before.
        makespan_s: Time of the last lock, over all complete missions.
        way_m: Way that all units of a mission have driven.
        parallel_percent: Share of the time with any motion in which two units or more moved.
        lost_percent: Share of the messages sent over the radio that were lost.
        replans: Number of routes that were planned because an earlier one could not be driven to its end.
    """

    docks: StepFigures
    docks_again: StepFigures
    makespan_s: Quantiles
    way_m: Quantiles
    parallel_percent: Quantiles
    lost_percent: Quantiles
    replans: Quantiles


class SweepSummary(BaseModel, frozen=True):
    """Summary of many trials of one scene.

    Attributes:
        scene: Name of the scene.
        scene_hash: Hash of the scene as it was run, overrides included.
        code: Fingerprint of the code, see :mod:`msrr_bullet.sweep.provenance`.
        plant: Plant that moved the units.
        perception: Kind of perception of the robots.
        as_built: Grade of the workmanship; see :class:`~msrr_bullet.trial.result.TrialResult`.
        trials: Number of trials, failures of the program included.
        outcomes: Number of trials by outcome; failures of the program are not included.
        success: Rate of ``docked``, or of ``complete`` for missions, among all trials, with the 95 % Wilson
            interval.
        min_clearance_m: Smallest clearance over all trials; None when there was no body to come near.
        false_docks: Number of trials in which a robot believed in a dock that was none.
        redraws: Number of starts over all trials that were drawn again because the target lay outside the
            outer cone.
        steps: Summary of every step of the plan, in order; empty for missions.
        mission: Summary of the missions; None without a base station.
        reused: Number of trials taken from the store.
        unsuccessful: Trials that ended otherwise than ``docked`` or ``complete``, by seed.
        failures: Trials without a result.
        interrupted: Whether the sweep was stopped before all seeds were run.
    """

    scene: str
    scene_hash: str
    code: str
    plant: Plant
    perception: Perception
    as_built: str = "perfect"
    trials: int
    outcomes: dict[str, int]
    success: Rate
    min_clearance_m: float | None
    false_docks: int
    redraws: int
    steps: tuple[StepSummary, ...]
    mission: MissionSummary | None = None
    reused: int = 0
    unsuccessful: tuple[Unsuccessful, ...] = ()
    failures: tuple[TrialFailure, ...] = ()
    interrupted: bool = False

    @property
    def goal(self) -> Outcome:
        """The outcome of a trial that succeeds."""
        return Outcome.DOCKED if self.mission is None else Outcome.COMPLETE

    @property
    def docking_steps(self) -> list[tuple[str, StepFigures]]:
        """The docking steps of the scene by name; those of a mission are taken together."""
        if self.mission is not None:
            return [("all docking steps", self.mission.docks)]
        return [(f"{step.unit} to {step.target}", step) for step in self.steps]

    def to_json(self) -> str:
        """Return the summary as indented JSON."""
        return self.model_dump_json(indent=2) + "\n"

    def _repr_html_(self) -> str:
        """Return the summary as a notebook shows it: a table."""
        s = self.success
        rows = [
            (f"{name}: {what}", *_cells(q))
            for name, step in self.docking_steps
            for what, q in (
                ("lateral error at first contact [mm]", step.contact_lateral_mm),
                ("yaw error at first contact [deg]", step.contact_yaw_deg),
                ("gap between seated faces [mm]", step.seated_axial_mm),
                ("attempts", step.attempts),
            )
        ]
        rows += [(outcome, str(count), "", "") for outcome, count in self.outcomes.items()]
        rows += (
            [("without a result, counted as not succeeded", str(len(self.failures)), "", "")]
            if self.failures
            else []
        )
        kind = f"{self.plant}, {self.perception}, {self.as_built}"
        rate = f"{100 * s.rate:.1f} % succeed, 95 % interval {100 * s.low:.1f} .. {100 * s.high:.1f} %"
        title = f"{self.scene}, {counted(self.trials, 'trial')} ({kind}): {rate}"
        head = ("", "median (95 % interval)", "95 % (95 % interval)", "largest")
        return html_table(title, rows, head)


def _cells(values: Quantiles) -> tuple[str, str, str]:
    """Return median and 95 % with their confidence intervals, and the largest value, as text."""
    p50, p95, largest = ("" if v is None else f"{v:z.2f}" for v in (values.p50, values.p95, values.max))
    bounds = [interval_text(interval) for interval in (values.p50_interval, values.p95_interval)]
    median, high = (f"{v} ({b})" if b else v for v, b in zip((p50, p95), bounds, strict=True))
    return median, high, largest
