"""The results of a tolerance study: the JSON from which page, figure and tables are made.

Sizes and errors of an effect are in the unit that the effect names, lateral errors in millimetres and yaw
errors in degrees.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Self

import numpy as np
from pydantic import BaseModel

from msrr_bullet.statistics import Quantiles, Rate, quantiles, wilson
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.as_built import Grade
from msrr_scenes.specs.control import Perception, Plant


class StudyPart(BaseModel, frozen=True, extra="forbid"):
    """A part of the results: frozen, without unknown keys."""


class ContactError(StudyPart):
    """The true errors of the port at the first contact of a pin, with their signs.

    Attributes:
        lateral_mm: Offset from the axis of the target port, positive to the left [mm].
        yaw_deg: Angle to that axis [deg].
    """

    lateral_mm: float
    yaw_deg: float


class StudyTrial(StudyPart):
    """One trial.

    Attributes:
        seed: Seed of all random streams.
        error: True error that it had, or the standard deviation of a drawn one; None for a grade.
        outcome: Verdict of the judge, or ``no_result``.
        succeeded: Whether all units docked.
        error_text: Why there is no result; empty if there is one.
        bad_input: Whether there is none because of what was asked for; see
            :class:`~msrr_bullet.sweep.summary.TrialFailure`.
        contacts: Errors at contact of every dock ``<unit> to <unit>.<port>``.
    """

    seed: int
    error: float | None
    outcome: str
    succeeded: bool
    error_text: str = ""
    bad_input: bool = False
    contacts: dict[str, ContactError]


class Sample(StudyPart):
    """Trials under one condition.

    Attributes:
        trials: The trials, by seed.
        docked: Rate of success with its 95 % Wilson interval.
        lateral_mm: Magnitudes of the lateral errors at contact.
        yaw_deg: Magnitudes of the yaw errors at contact.
        outcomes: Number of trials by outcome, the most frequent one first.
    """

    trials: tuple[StudyTrial, ...]
    docked: Rate
    lateral_mm: Quantiles
    yaw_deg: Quantiles
    outcomes: dict[str, int]

    @property
    def successes(self) -> int:
        """Number of trials that succeeded."""
        return sum(trial.succeeded for trial in self.trials)

    @property
    def lateral_rms_mm(self) -> float | None:
        """Root of the mean squared lateral error at contact [mm]; None without a contact."""
        found = [contact.lateral_mm for trial in self.trials for contact in trial.contacts.values()]
        return float(np.sqrt(np.mean(np.square(found)))) if found else None

    @classmethod
    def of(cls, trials: Iterable[StudyTrial], **condition: object) -> Self:
        """Summarise trials, under the condition that the other attributes say."""
        kept = tuple(sorted(trials, key=lambda trial: trial.seed))
        contacts = [contact for trial in kept for contact in trial.contacts.values()]
        figures = {
            "trials": kept,
            "docked": wilson(sum(trial.succeeded for trial in kept), len(kept)),
            "lateral_mm": quantiles(abs(contact.lateral_mm) for contact in contacts),
            "yaw_deg": quantiles(abs(contact.yaw_deg) for contact in contacts),
            "outcomes": dict(Counter(trial.outcome for trial in kept).most_common()),
        }
        return cls.model_validate({**figures, **condition})


class SizeSample(Sample):
    """Trials with one effect of one size.

    Attributes:
        size: Size of the effect.
        holds: Whether at least 95 % of the trials docked. A size at which that cannot be reached any more is
            given up, so that not every seed was run.
    """

    size: float
    holds: bool


class GradeSample(Sample):
    """Trials in which everything was drawn by one grade.

    Attributes:
        grade: Grade of the workmanship.
    """

    grade: Grade


class Slope(StudyPart):
    """Change of an error at contact per unit of an effect, over pairs of trials with and without the effect.

    Attributes:
        rms: Root of the squared changes over the squared sizes, less what chance makes of it.
        low: Lower bound of its 95 % interval, from the scatter of the squares between trials; 0 if chance
            may be all of it.
        high: Upper bound.
        systematic: Least squares of the signed change on the signed error, through the origin: the part that
            is the same in every trial. None for errors that are drawn for each tag.
        pairs: Number of pairs.
    """

    rms: float
    low: float
    high: float
    systematic: float | None
    pairs: int


class EffectResult(StudyPart):
    """One effect alone.

    Attributes:
        name: Key of the quantity, see :class:`msrr_bullet.tolerance.effects.Effect`.
        description: What the quantity is.
        unit: Unit of all sizes.
        step: Size by which effects are compared: one standard deviation of ``careful`` if ``graded``.
        graded: Whether the grades have this effect.
        both_signs: Whether half of the trials had the error with a minus.
        drawn: Whether the size is a standard deviation, with which every tag has an error of its own.
        top: Largest size that was tried, or would have been.
        samples: Trials by size, the smallest size first.
        measured: Size at which the slopes are measured.
        holds: Largest size at which at least 95 % docked; 0 if they did at none.
        fails: Smallest size beyond ``holds`` at which fewer did; None if there is none up to ``top``.
        surely_fails: Smallest size beyond ``holds`` at which so many failed that it would happen in at most
            one of 40 studies if 95 % docked.
        threshold: Size between ``holds`` and ``fails`` that stands for both.
        lateral: Lateral error per unit [mm]; None without a contact.
        yaw: Yaw error per unit [deg]; None without a contact.
    """

    name: str
    description: str
    unit: str
    step: float
    graded: bool
    both_signs: bool
    drawn: bool
    top: float
    samples: tuple[SizeSample, ...]
    measured: float
    holds: float
    fails: float | None
    surely_fails: float | None
    threshold: float | None
    lateral: Slope | None
    yaw: Slope | None

    def sample(self, size: float) -> SizeSample:
        """Return the trials with this size."""
        return next(sample for sample in self.samples if sample.size == size)


class ToleranceStudy(StudyPart):
    """The whole study.

    Attributes:
        scene: Name of the scene.
        scene_hash: Hash of the scene that was given, overrides included.
        overrides: Values that were set in the scene for this study, by key.
        plant: Plant that moved the units.
        perception: Kind of perception of the robots.
        told: Tolerances that the robots know while effects are tried alone.
        versions: Versions of Python and packages.
        all_graded: Whether all effects that the grades have and that act in the scene were tried.
        seeds: Seeds of every effect, and of the trials without any.
        drawn: Trials in which everything is as designed, with the seeds of the effects.
        chance_lateral: Change of the lateral error at contact in a trial by an error that is too small to
            matter, over the same seeds [mm]; None without a contact.
        chance_yaw: The same of the yaw error [deg].
        grades: Trials with everything together, by grade.
        effects: Every effect alone.
    """

    scene: str
    scene_hash: str
    overrides: dict[str, str] = {}
    plant: Plant
    perception: Perception
    told: str
    versions: dict[str, str]
    all_graded: bool = True
    seeds: tuple[int, ...]
    drawn: Sample
    chance_lateral: Slope | None
    chance_yaw: Slope | None
    grades: tuple[GradeSample, ...]
    effects: tuple[EffectResult, ...]

    @property
    def failures(self) -> list[str]:
        """Every trial without a result, in words."""
        return [
            f"{name}, seed {trial.seed} gave no result: {trial.error_text}"
            for name, trial in self._without_result()
        ]

    @property
    def only_bad_input(self) -> bool:
        """Whether every trial without a result has none because of what was asked for."""
        return all(trial.bad_input for _, trial in self._without_result())

    @property
    def program_failures(self) -> list[str]:
        """Condition and seed of every trial in which the program of a unit failed."""
        failed = Outcome.PROGRAM_FAILED.value
        return [f"{name}, seed {trial.seed}" for name, trial in self._trials() if trial.outcome == failed]

    def _without_result(self) -> Iterator[tuple[str, StudyTrial]]:
        """Yield every trial without a result, with its condition in words."""
        yield from ((name, trial) for name, trial in self._trials() if trial.error_text)

    def _trials(self) -> Iterator[tuple[str, StudyTrial]]:
        """Yield every trial, with its condition in words."""
        conditions: list[tuple[str, Sample]] = [("as designed", self.drawn)]
        conditions += [(sample.grade, sample) for sample in self.grades]
        conditions += [
            (f"{effect.name} of {sample.size:g} {effect.unit}".rstrip(), sample)
            for effect in self.effects
            for sample in effect.samples
        ]
        for name, sample in conditions:
            yield from ((name, trial) for trial in sample.trials)

    def to_json(self) -> str:
        """Return the study as indented JSON."""
        return self.model_dump_json(indent=1) + "\n"
