"""The long-distance phase on unicycles: a law in a setting, as a row of a table or over time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from msrr_bullet.studies.measures import OBSTACLE_MEASURES, paper_measures
from msrr_bullet.studies.model import Measured, Row, count_within_paper, rates_of
from msrr_bullet.studies.series import Series
from msrr_bullet.studies.settings import PAPER_PACE, Setting, merge_params
from msrr_control.parameters import read_params
from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams, C1PathFollowingState
from msrr_control.path_following.c2 import C2PathFollowingLaw, C2PathFollowingParams
from msrr_control.path_following.law import PathFollowingLaw
from msrr_control.path_following.path import PaceSpec
from msrr_control.path_following.walls import WallSpec
from msrr_control.studies.path_following_study import PathFollowingStudyResult, run_path_following_study
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.spec import Choice

#: Distance of the controlled point ahead of the axle [m].
OFFSET = 0.10


def path_following_law(choice: Choice, setting: Setting) -> PathFollowingLaw[Any]:
    """Build a law of the long-distance phase by the name of its assembler.

    Raises:
        UnknownNameError: No law has this name.
        ParameterError: A parameter of the law is wrong.
    """
    params = merge_params({"pace": PAPER_PACE.model_dump()}, choice.params)
    limits = setting.scene.limits
    if choice.name == "c1":
        return C1PathFollowingLaw(read_params(C1PathFollowingParams, params), limits, OFFSET)
    if choice.name == "c2":
        return C2PathFollowingLaw(read_params(C2PathFollowingParams, params), limits, OFFSET)
    raise UnknownNameError("long-distance law", choice.name, ("c1", "c2"), "")


def run_path_following(
    choice: Choice, setting: Setting, seeds: range, observer: Callable[[Any], None] | None = None
) -> PathFollowingStudyResult:
    """Run a trial for each seed; paths, starts and noise are the same for every law.

    They follow from the first seed and the number of seeds: another range draws others for the same seed.
    """
    return _run(choice, setting, stream(seeds.start, f"study/long/{setting.limits}"), len(seeds), observer)


def _run(
    choice: Choice,
    setting: Setting,
    rng: np.random.Generator,
    trials: int,
    observer: Callable[[Any], None] | None = None,
) -> PathFollowingStudyResult:
    return run_path_following_study(
        path_following_law(choice, setting),
        setting.scene.limits,
        rng,
        trials,
        setting.path_following_starts,
        setting.disturbance,
        walls=WallSpec.model_validate(choice.params.get("walls", {})),
        pace=PaceSpec.model_validate(choice.params.get("pace", {})),
        observer=observer,
    )


def path_following_row(choice: Choice, label: str, setting: Setting, seeds: range) -> Row:
    """Return a law's row of a table of the long phase."""
    result = run_path_following(choice, setting, seeds)
    obstacle_m = setting.path_following_starts.obstacle_m or 0.0
    values = {**result.figures(), "clearance": result.body_distance().min(axis=0) - obstacle_m}
    clear = values["clearance"] > 0.0
    within_paper = clear.copy()
    for measure in paper_measures(("long",)):
        # A unit still passing its obstacle at the end of the arc has no tracking error and does not meet it;
        # a path that met no obstacle has neither amplitude nor recovery, and they do not count.
        met = values[measure.key] <= (measure.paper_c1 or np.inf)
        if measure.key in OBSTACLE_MEASURES:
            met |= np.isnan(values[measure.key])
        within_paper &= met
    return Row(
        controller=choice.name,
        label=label,
        trials=len(seeds),
        **rates_of(success=clear),
        measures={key: Measured.of(found) for key, found in values.items()},
        met=count_within_paper(values),
        within_paper=int(within_paper.sum()),
    )


def path_following_series(choice: Choice, setting: Setting, seed: int) -> Series:
    """Return one trial over time."""
    states: list[C1PathFollowingState] = []

    def keep_c1_state(state: object) -> None:
        if isinstance(state, C1PathFollowingState):
            states.append(state)

    result = _run(choice, setting, stream(seed, "panel/long"), 1, keep_c1_state)
    tip, desired, yaw = result.tip[:, 0], result.desired[:, 0], result.pose[:, 0, 2]
    # The path's heading is that of the desired point's motion; where the point rests, the last one counts.
    moved = np.diff(desired, axis=0, prepend=desired[:1])
    moving = np.hypot(moved[:, 0], moved[:, 1]) > 1e-6
    last = np.maximum.accumulate(np.where(moving, np.arange(len(moved)), 0))
    heading = np.unwrap(np.arctan2(moved[last, 1], moved[last, 0]))
    yaw_error = np.angle(np.exp(1j * (yaw - heading)))
    auxiliary = {}
    if states:
        auxiliary = {
            "lambda_phi": np.stack([s.guidance.lam[0] for s in states]),
            "lambda": np.stack([s.tracking.lam[0] for s in states]),
            "lambda_s": np.stack([s.tracking.lam_s[0] for s in states]),
        }
    x, y = (float(value) for value in result.obstacle[0])
    limits = setting.scene.limits
    return Series(
        time=result.time,
        tip=tip,
        reference=desired,
        error=np.column_stack([tip - desired, yaw_error]),
        command=result.command[:, 0],
        twist=result.twist[:, 0],
        distance=result.body_distance()[:, 0],
        auxiliary=auxiliary,
        obstacle=(x, y, setting.path_following_starts.obstacle_m or 0.0),
        limits=(limits.v_max_mps, limits.w_max_radps),
    )
