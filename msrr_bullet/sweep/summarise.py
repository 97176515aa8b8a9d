"""From the results of trials to the summary of a sweep."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from msrr_bullet.statistics import Quantiles, quantiles, wilson
from msrr_bullet.sweep.summary import (
    MissionSummary,
    StepFigures,
    StepSummary,
    SweepSummary,
    TrialFailure,
    Unsuccessful,
)
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.step_result import StepResult
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.messages import ExposureCounts
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene


def _known(values: Iterable[float | None]) -> Iterator[float]:
    return (value for value in values if value is not None)


def _disagreeing(seen: Iterable[ExposureCounts | None]) -> Iterator[float]:
    """Return the shares of exposures that do not agree with the filter [%]."""
    return (100.0 * exposures.disagreeing for exposures in seen if exposures is not None)


def _counts(outcomes: Counter[Outcome]) -> dict[str, int]:
    return {o.value: outcomes[o] for o in Outcome if outcomes[o]}


def summarise(
    scene: Scene,
    code: str,
    ended: Sequence[TrialResult | TrialFailure],
    *,
    reused: int = 0,
    interrupted: bool = False,
) -> SweepSummary:
    """Return the summary of trials of a scene.

    ``code`` is the fingerprint of the code when they began; all else is as in
    :class:`~msrr_bullet.sweep.summary.SweepSummary`.
    """
    trials = [outcome for outcome in ended if isinstance(outcome, TrialResult)]
    failures = [outcome for outcome in ended if isinstance(outcome, TrialFailure)]
    outcomes = Counter(r.outcome for r in trials)
    steps = [step for r in trials for step in r.steps]
    plan = () if scene.coordinated else scene.docks
    return SweepSummary(
        scene=scene.name,
        scene_hash=trials[0].scene_hash if trials else scene_hash(scene),
        code=code,
        plant=scene.plant,
        perception=scene.perception,
        as_built=str(scene.as_built),
        trials=len(ended),
        outcomes=_counts(outcomes),
        success=wilson(sum(r.docked for r in trials), len(ended)),
        min_clearance_m=min(_known(r.min_clearance_m for r in trials), default=None),
        false_docks=sum(any(s.outcome is Outcome.FALSE_DOCK for s in r.steps) for r in trials),
        redraws=sum(r.start_redraws for r in trials),
        steps=tuple(
            StepSummary(
                unit=planned.unit,
                target=planned.to,
                **_figures([step for step in steps if step.index == index], independent=True).model_dump(),
            )
            for index, planned in enumerate(plan)
        ),
        mission=_summarise_missions(trials) if scene.coordinated else None,
        reused=reused,
        unsuccessful=tuple(
            Unsuccessful(seed=r.seed, outcome=r.outcome, reason=r.reason)
            for r in sorted(trials, key=lambda r: r.seed)
            if not r.docked
        ),
        failures=tuple(sorted(failures, key=lambda f: f.seed)),
        interrupted=interrupted,
    )


def _summarise_missions(trials: list[TrialResult]) -> MissionSummary:
    """Summarise the missions of trials in which a base station led the units."""
    missions = [r.mission for r in trials if r.mission is not None]
    talking = [m for m in missions if m.messages_sent]
    complete = [r.mission for r in trials if r.mission is not None and r.docked]
    return MissionSummary(
        docks=_figures([step for r in trials for step in r.steps if not step.undocks], independent=False),
        docks_again=_figures([step for r in trials for step in _docks_again(r)], independent=False),
        makespan_s=quantiles(_known(m.makespan_s for m in complete), independent=True),
        way_m=quantiles((m.total_way_m for m in missions), independent=True),
        parallel_percent=quantiles((100.0 * m.parallel_share for m in missions), independent=True),
        lost_percent=quantiles(
            (100.0 * m.messages_lost / m.messages_sent for m in talking), independent=True
        ),
        replans=quantiles((float(m.replans) for m in missions), independent=True),
    )


def _docks_again(trial: TrialResult) -> Iterator[StepResult]:
    """Yield the docking steps at a port where the same unit had docked before."""
    before: set[tuple[str, str]] = set()
    for step in trial.steps:
        if step.undocks:
            continue
        if (step.unit, step.target) in before:
            yield step
        if step.docked:
            before.add((step.unit, step.target))


def _figures(results: list[StepResult], *, independent: bool) -> StepFigures:
    """Return the figures of steps, which are independent of each other if each is of another trial."""

    def of(values: Iterable[float]) -> Quantiles:
        return quantiles(values, independent=independent)

    contacts = [r.contact for r in results if r.contact is not None]
    seatings = [r.seating for r in results if r.seating is not None and r.seating.seated]
    figures = [r.assembly for r in results if r.assembly is not None]
    by_attempt = Counter(len(r.attempts) for r in results if r.docked)
    return StepFigures(
        trials=len(results),
        outcomes=_counts(Counter(r.outcome for r in results)),
        contact_lateral_mm=of(1000.0 * c.lateral_m for c in contacts),
        contact_yaw_deg=of(math.degrees(c.yaw_rad) for c in contacts),
        seated_axial_mm=of(1000.0 * s.axial_gap_m for s in seatings),
        tracking_error_m=of(_known(f.tracking_error_m for f in figures)),
        amplitude_m=of(_known(f.amplitude_m for f in figures)),
        recovery_s=of(
            math.inf if f.recovery_s is None else f.recovery_s for f in figures if f.amplitude_m is not None
        ),
        onboard_disagreeing_percent=of(_disagreeing(r.onboard_exposures for r in results)),
        overhead_disagreeing_percent=of(_disagreeing(r.overhead_exposures for r in results)),
        attempts=of(float(len(r.attempts)) for r in results),
        docked_by_attempt=dict(sorted(by_attempt.items())),
        min_clearance_m=min(_known(r.min_clearance_m for r in results), default=None),
    )
