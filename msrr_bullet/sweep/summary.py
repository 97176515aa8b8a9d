"""What a sweep says: counts, a rate with its interval, and quantiles."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from pydantic import BaseModel, ConfigDict

from msrr_bullet.statistics import Quantiles, Rate, quantiles, wilson
from msrr_bullet.trial.result import TrialResult
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import Perception, Plant
from msrr_scenes.specs.scene import Scene


class TrialFailure(BaseModel):
    """A trial that gave no result: the program failed, not the robot."""

    model_config = ConfigDict(frozen=True)

    seed: int
    error: str


class SweepSummary(BaseModel):
    """Summary of many trials of one scene.

    Attributes:
        scene: Name of the scene.
        scene_hash: Hash of the scene as it was run, overrides included.
        code: Fingerprint of the code, see :mod:`msrr_bullet.sweep.provenance`.
        plant: What moved the units.
        perception: What the robots saw with.
        trials: Number of trials, failures of the program included.
        outcomes: How often each outcome came; failures of the program are not among them.
        success: Rate of ``docked`` among all trials, with the 95 % Wilson interval.
        contact_lateral_mm: At the first pin contact, of all trials that came to it (truth).
        contact_yaw_deg: The same for the yaw error.
        seated_axial_mm: Gap between the faces, of all trials that ended seated (truth).
        tracking_error_m: Of the long-distance phase, of all trials that ended an arc; see
            :class:`msrr_bullet.trial.result.AssemblyFigures`.
        amplitude_m: The same, of all trials that passed an obstacle.
        recovery_s: The same.
        attempts: Number of attempts, of all trials.
        docked_by_attempt: How many docked on which attempt; of a plan with several steps, that of the step
            which needed most.
        min_clearance_m: Smallest over all trials; None when nothing was there to come near.
        false_docks: The robot said docked, and it was not.
        redraws: Starts thrown away because the target lay outside the outer cone, over all trials.
        reused: Trials taken from the store.
        failures: Trials that gave no result.
        interrupted: The sweep was stopped before all seeds were run.
    """

    model_config = ConfigDict(frozen=True)

    scene: str
    scene_hash: str
    code: str
    plant: Plant
    perception: Perception
    trials: int
    outcomes: dict[str, int]
    success: Rate
    contact_lateral_mm: Quantiles
    contact_yaw_deg: Quantiles
    seated_axial_mm: Quantiles
    tracking_error_m: Quantiles
    amplitude_m: Quantiles
    recovery_s: Quantiles
    attempts: Quantiles
    docked_by_attempt: dict[int, int]
    min_clearance_m: float | None
    false_docks: int
    redraws: int
    reused: int = 0
    failures: tuple[TrialFailure, ...] = ()
    interrupted: bool = False

    def to_json(self) -> str:
        """Return the summary as indented JSON."""
        return self.model_dump_json(indent=2) + "\n"


def _known(values: Iterable[float | None]) -> Iterator[float]:
    return (value for value in values if value is not None)


def summarise(
    scene: Scene,
    scene_hash: str,
    code: str,
    results: Iterable[TrialResult],
    failures: Sequence[TrialFailure] = (),
    *,
    reused: int = 0,
    interrupted: bool = False,
) -> SweepSummary:
    """Summarise the results of one scene."""
    trials = list(results)
    outcomes = Counter(r.outcome for r in trials)
    contacts = [r.contact for r in trials if r.contact is not None]
    seatings = [r.seating for r in trials if r.seating is not None and r.seating.seated]
    clearances = [r.min_clearance_m for r in trials if r.min_clearance_m is not None]
    figures = [r.assembly for r in trials if r.assembly is not None]
    # Of a plan with several steps: by the attempt that its worst step needed.
    by_attempt = Counter(max((a.attempt for a in r.records), default=r.attempts) for r in trials if r.docked)
    return SweepSummary(
        scene=scene.name,
        scene_hash=scene_hash,
        code=code,
        plant=scene.plant,
        perception=scene.perception,
        trials=len(trials) + len(failures),
        outcomes={o.value: outcomes[o] for o in Outcome if outcomes[o]},
        success=wilson(outcomes[Outcome.DOCKED], len(trials) + len(failures)),
        contact_lateral_mm=quantiles(1000.0 * c.lateral_m for c in contacts),
        contact_yaw_deg=quantiles(math.degrees(c.yaw_rad) for c in contacts),
        seated_axial_mm=quantiles(1000.0 * s.axial_gap_m for s in seatings),
        tracking_error_m=quantiles(_known(f.tracking_error_m for f in figures)),
        amplitude_m=quantiles(_known(f.amplitude_m for f in figures)),
        recovery_s=quantiles(_known(f.recovery_s for f in figures)),
        attempts=quantiles(float(r.attempts) for r in trials),
        docked_by_attempt=dict(sorted(by_attempt.items())),
        min_clearance_m=min(clearances, default=None),
        false_docks=outcomes[Outcome.FALSE_DOCK],
        redraws=sum(r.start_redraws for r in trials),
        reused=reused,
        failures=tuple(sorted(failures, key=lambda f: f.seed)),
        interrupted=interrupted,
    )
