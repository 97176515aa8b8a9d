"""The long-distance phase on unicycles: a law in a setting, as a row of a table or over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from msrr_bullet.studies.close_studies import merged, pairs
from msrr_bullet.studies.measures import paper_figures
from msrr_bullet.studies.model import Measured, Row, Series, met_of, rate_of
from msrr_bullet.studies.settings import PAPER_PACE, Setting
from msrr_control.parameters import read_params
from msrr_control.path_following.baseline import C2PathFollowingLaw, C2PathFollowingParams
from msrr_control.path_following.c1 import C1PathFollowingLaw, C1PathFollowingParams, C1PathFollowingState
from msrr_control.path_following.law import PathFollowingLaw
from msrr_control.path_following.walls import WallSpec
from msrr_control.studies.path_following_study import PathFollowingStudyResult, run_path_following_study
from msrr_scenes.errors import UnknownNameError
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.spec import Choice

#: Half the body's length and width [m].
_HALF_BODY = 0.10

#: Controlled point ahead of the axle [m].
_OFFSET = 0.10


def long_law(choice: Choice, setting: Setting) -> PathFollowingLaw[Any]:
    """Build a law of the long-distance phase by the name of its assembler.

    Raises:
        UnknownNameError: There is none of that name.
        SceneError: Its parameters are wrong.
    """
    params = merged({"pace": PAPER_PACE.model_dump()}, choice.params)
    limits = setting.limits_spec
    if choice.name == "c1":
        return C1PathFollowingLaw(read_params("c1", C1PathFollowingParams, params), limits, _OFFSET)
    if choice.name == "c2":
        return C2PathFollowingLaw(read_params("c2", C2PathFollowingParams, params), limits, _OFFSET)
    raise UnknownNameError("long-distance law", choice.name, ("c1", "c2"), "")


def run_long(choice: Choice, setting: Setting, seeds: range) -> PathFollowingStudyResult:
    """Study a law: a trial for each seed; paths, starts and noise are the same for every law."""
    walls = WallSpec.model_validate(choice.params.get("walls", {}))
    return run_path_following_study(
        long_law(choice, setting),
        setting.limits_spec,
        stream(seeds.start, f"study/long/{setting.limits}"),
        len(seeds),
        setting.long_starts,
        setting.disturbance,
        walls=walls,
    )


def long_row(choice: Choice, label: str, setting: Setting, seeds: range) -> Row:
    """Return a law's row of a table of the long phase."""
    result = run_long(choice, setting, seeds)
    found = {
        "tracking": result.tracking_error(),
        "amplitude": result.amplitude(),
        "amplitude_path": result.amplitude_from_path(),
        "recovery": result.recovery_time(),
        "recovery_path": result.recovery_to_path(),
        "clearance": result.body_distance(_HALF_BODY, _HALF_BODY) - (setting.long_starts.obstacle_m or 0.0),
    }
    clear = found["clearance"] > 0.0
    met = np.array(clear)
    for what in paper_figures(("long",)):
        # One still about its obstacle at the end of the arc has no tracking error: it does not meet that.
        met &= found[what.key] <= (what.paper_c1 or np.inf)
    return Row(
        controller=choice.name,
        label=label,
        trials=len(seeds),
        success=rate_of(clear),
        measures={key: Measured.of(values) for key, values in found.items()},
        met=met_of(found),
        within_paper=int(met.sum()),
    )


def long_series(choice: Choice, setting: Setting, seed: int) -> Series:
    """Return one trial over time."""
    states: list[C1PathFollowingState] = []

    def keep(state: object) -> None:
        if isinstance(state, C1PathFollowingState):
            states.append(state)

    walls = WallSpec.model_validate(choice.params.get("walls", {}))
    limits = setting.limits_spec
    result = run_path_following_study(
        long_law(choice, setting),
        limits,
        stream(seed, "panel/long"),
        1,
        setting.long_starts,
        setting.disturbance,
        walls=walls,
        observer=keep,
    )
    gap = result.tip[:, 0] - result.desired[:, 0]
    # The path's heading is that of the desired point's motion; where it rests, the last one counts.
    moved = np.diff(result.desired[:, 0], axis=0, prepend=result.desired[:1, 0])
    moving = np.hypot(moved[:, 0], moved[:, 1]) > 1e-6
    last = np.maximum.accumulate(np.where(moving, np.arange(len(moved)), 0))
    heading = np.unwrap(np.arctan2(moved[last, 1], moved[last, 0]))
    off = np.angle(np.exp(1j * (result.pose[:, 0, 2] - heading)))
    c, s = np.cos(result.pose[:, 0, 2]), np.sin(result.pose[:, 0, 2])
    to = result.obstacle[0] - result.pose[:, 0, :2]
    along = np.maximum(np.abs(c * to[:, 0] + s * to[:, 1]) - _HALF_BODY, 0.0)
    across = np.maximum(np.abs(c * to[:, 1] - s * to[:, 0]) - _HALF_BODY, 0.0)
    auxiliary = {}
    if states:
        auxiliary = {
            "lambda_phi": pairs(np.stack([s.guidance.lam[0] for s in states])),
            "lambda": pairs(np.stack([s.tracking.lam[0] for s in states])),
            "lambda_s": pairs(np.stack([s.tracking.lam_s[0] for s in states])),
        }
    error = np.round(np.column_stack([gap, off]), 6)
    return Series(
        time=tuple(float(t) for t in np.round(result.time, 6)),
        tip=pairs(result.tip[:, 0]),
        reference=pairs(result.desired[:, 0]),
        error=tuple((float(x), float(y), float(t)) for x, y, t in error),
        command=pairs(result.command[:, 0]),
        twist=pairs(result.twist[:, 0]),
        distance=tuple(float(d) for d in np.round(np.hypot(along, across), 6)),
        auxiliary=auxiliary,
        obstacle=(
            float(result.obstacle[0, 0]),
            float(result.obstacle[0, 1]),
            setting.long_starts.obstacle_m or 0.0,
        ),
        limits=(limits.v_max_mps, limits.w_max_radps),
    )
