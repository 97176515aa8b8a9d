"""A trial of the real loop with the paper's figures."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from msrr_bullet.reproduce.trial_series import DockingSeries, SeriesRecorder
from msrr_bullet.timeline.path_following_series import PathFollowingSeries
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.step_result import Contact
from msrr_scenes.specs.scene import Scene


class MeasuredTrial(TrialResult, ser_json_inf_nan="strings"):
    """A trial's result with the measures of both phases of its last step.

    Attributes:
        measures: Measures by key, in SI, see :mod:`msrr_bullet.studies.measures`. The settling time of a
            trial that never settled, or never came to an approach, is infinite, and so is the recovery of one
            that ended at its obstacle.
        kept_in_view: Whether both edges of the target stayed in the field of view of the unit's camera in
            every approach, from the hand-over to the contact, by truth; None without an approach.
        kept_in_cone: Whether both edges stayed within the outer bound of the line of sight, which is narrower
            than the field of view; None without an approach.
    """

    measures: dict[str, Annotated[float, Field(allow_inf_nan=True)]] = Field(default_factory=dict)
    kept_in_view: bool | None = None
    kept_in_cone: bool | None = None


def record_trial(
    scene: Scene, seed: int
) -> tuple[TrialResult, PathFollowingSeries | None, DockingSeries | None]:
    """Run a trial; return its result and the series of the two phases of its last step, None if missing."""
    # A process that only starts trials elsewhere does not load the simulator.
    from msrr_bullet.trial.trial import Trial

    step = scene.docks[-1]
    recorder = SeriesRecorder(step.unit)
    result = Trial(scene, seed, recorder=recorder).run()
    offset = scene.geometry(step.unit).control_offset(step.port)
    contact = _last_contact(scene, result)
    return (
        result,
        PathFollowingSeries.of(recorder.instants, step.unit, offset),
        DockingSeries.of(recorder.instants, scene, contact.time_s if contact is not None else None),
    )


def _last_contact(scene: Scene, result: TrialResult) -> Contact | None:
    """Return the first pin contact in the last step of the plan; None without one, or if it never began."""
    last = result.steps[-1]
    return last.contact if last.index == len(scene.docks) - 1 else None


def measured_trial(scene: Scene, seed: int) -> MeasuredTrial:
    """Run a trial and measure it; a :data:`msrr_bullet.sweep.worker_pool.TrialFunction`."""
    result, path_following, docking = record_trial(scene, seed)
    measures = {} if docking is not None else {"settling": math.inf}
    if path_following is not None:
        measures.update(path_following.measures())
    if docking is not None:
        measures.update(docking.measures())
    contact = _last_contact(scene, result)
    if contact is not None:
        measures["contact"] = contact.time_s
        measures["lateral"], measures["yaw"] = contact.lateral_m, contact.yaw_rad
    values = {name: getattr(result, name) for name in TrialResult.model_fields}
    half_fov = scene.cameras.onboard.lens.half_fov
    return MeasuredTrial(
        **values,
        measures=measures,
        kept_in_view=docking.kept_within(half_fov) if docking is not None else None,
        kept_in_cone=docking.kept_within(scene.los.outer) if docking is not None else None,
    )
