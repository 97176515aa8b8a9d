"""The trials that a study asks for: those of one effect, size by size, and those of one condition."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping, Sequence

from msrr_bullet.sweep.summary import TrialFailure
from msrr_bullet.tolerance.effects import Effect
from msrr_bullet.tolerance.model import ContactError, EffectResult, SizeSample, Slope, StudyTrial
from msrr_bullet.tolerance.slopes import ContactQuantity, contact_slope
from msrr_bullet.tolerance.threshold_search import threshold_search
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.specs.scene import Scene

#: Least share of trials that dock where an effect is small enough.
REQUIRED = 0.95

#: Size of the first trials of an effect, over that by which effects are compared: the grade ``workshop``.
MEASURED = 2.0

#: Number of trials after which a size is first looked at, one of each sign: a trial that fails takes several
#: times as long as one that docks.
_FIRST = 2

#: Odds of as many failures, if :data:`REQUIRED` of the trials docked, at which that is ruled out.
_RULED_OUT = 0.025

#: A scene with the seeds of its trials.
Batch = tuple[Scene, tuple[int, ...]]

#: Results of the trials of batches, in their order.
Outcomes = list[TrialResult | TrialFailure]


def study_trial(outcome: TrialResult | TrialFailure, error: float | None = None) -> StudyTrial:
    """Return what a study keeps of a trial.

    It has a result, or why it has none; ``error`` is the true error that it had, in the unit in which the
    effect is shown.
    """
    if isinstance(outcome, TrialFailure):
        return StudyTrial(
            seed=outcome.seed,
            error=error,
            outcome="no_result",
            succeeded=False,
            error_text=outcome.error,
            bad_input=outcome.bad_input,
            contacts={},
        )
    contacts = {
        f"{step.unit} to {step.target}": ContactError(
            lateral_mm=1000.0 * step.contact.port.y_m, yaw_deg=math.degrees(step.contact.port.yaw_rad)
        )
        for step in outcome.steps
        if step.contact is not None and not step.undocks
    }
    return StudyTrial(
        seed=outcome.seed,
        error=error,
        outcome=outcome.outcome.value,
        succeeded=outcome.docked,
        contacts=contacts,
    )


def condition_trials(
    scene: Scene, seeds: Sequence[int]
) -> Generator[list[Batch], Outcomes, list[StudyTrial]]:
    """Ask for the trials of one scene, and return them."""
    outcomes = yield [(scene, tuple(seeds))]
    return [study_trial(outcome) for outcome in outcomes]


def _ruled_out(failed: int, trials: int) -> bool:
    from scipy.stats import binom  # slow to import

    return float(binom.sf(failed - 1, trials, 1.0 - REQUIRED)) <= _RULED_OUT


class EffectTrials:
    """The trials of one effect alone: asked for size by size, and summarised when the search has ended."""

    def __init__(self, base: Scene, effect: Effect, seeds: Sequence[int]) -> None:
        """Begin with an effect on a scene without any true error.

        With an effect of two signs every other seed has the error with a minus.
        """
        self._base, self._effect = base, effect
        self._errors = {seed: effect.signs[i % len(effect.signs)] for i, seed in enumerate(seeds)}
        self._samples: dict[float, SizeSample] = {}

    def ask(self) -> Generator[list[Batch], Outcomes, EffectTrials]:
        """Yield batches of trials, is sent their outcomes in the same order, and return this object."""
        first = min(MEASURED * self._effect.step, self._effect.top)
        search = threshold_search(first, self._effect.top)
        try:
            holds = yield from self._try(next(search), completely=True)
            while True:
                holds = yield from self._try(search.send(holds), completely=False)
        except StopIteration as end:
            self._first, self._bracket = first, end.value
        return self

    def _try(self, size: float, completely: bool) -> Generator[list[Batch], Outcomes, bool]:
        seeds, trials = list(self._errors), list[StudyTrial]()
        required = math.ceil(REQUIRED * len(seeds) - 1e-9)  # 0.95 is a little more as a float
        cut = len(seeds) if completely else _FIRST
        for part in filter(None, (seeds[:cut], seeds[cut:])):
            batches = [
                (
                    self._effect.apply(self._base, sign * size),
                    tuple(s for s in part if self._errors[s] == sign),
                )
                for sign in self._effect.signs
            ]
            outcomes = yield [batch for batch in batches if batch[1]]
            trials += [
                study_trial(outcome, self._effect.scale * self._errors[outcome.seed] * size)
                for outcome in outcomes
            ]
            failed = sum(not trial.succeeded for trial in trials)
            if len(seeds) - failed < required:
                break
        holds = len(seeds) - failed >= required
        self._samples[size] = SizeSample.of(trials, size=self._effect.scale * size, holds=holds)
        return holds

    def result(
        self, without: Sequence[StudyTrial], chance: Mapping[ContactQuantity, Slope | None]
    ) -> EffectResult:
        """Return the result, against trials with the same seeds and without any effect.

        ``chance`` is what chance changes of each error at contact.
        """
        effect, scale = self._effect, self._effect.scale
        measured = self._samples[self._first]
        bracket = self._bracket
        slopes = {
            quantity: contact_slope(
                measured.trials, without, quantity, drawn=effect.drawn, chance=changes_by_chance
            )
            for quantity, changes_by_chance in chance.items()
        }
        surely = [
            sample.size
            for size, sample in self._samples.items()
            if size > bracket.holds and _ruled_out(len(sample.trials) - sample.successes, len(sample.trials))
        ]
        return EffectResult(
            name=effect.name,
            description=effect.description,
            unit=effect.unit,
            step=scale * effect.step,
            graded=effect.graded,
            both_signs=len(effect.signs) > 1,
            drawn=effect.drawn,
            top=scale * effect.top,
            samples=tuple(self._samples[size] for size in sorted(self._samples)),
            measured=measured.size,
            holds=scale * bracket.holds,
            fails=None if bracket.fails is None else scale * bracket.fails,
            surely_fails=min(surely, default=None),
            threshold=None if bracket.middle is None else scale * bracket.middle,
            lateral=slopes["lateral_mm"],
            yaw=slopes["yaw_deg"],
        )
