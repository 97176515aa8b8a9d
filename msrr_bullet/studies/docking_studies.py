"""The close-range phase on unicycles: a controller in a setting, as a row of a table or over time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.studies.measures import CAPTURE_DEG, CAPTURE_M, SETTLED_M, measure
from msrr_bullet.studies.model import Measured, Row, count_within_paper, rates_of
from msrr_bullet.studies.series import Series
from msrr_bullet.studies.settings import PAPER_TRAJECTORY, Setting, merge_params
from msrr_control.docking.controller import LawController, build_controller
from msrr_control.docking.corrected_law import CorrectedLawState
from msrr_control.docking.law import DockingLaw, DockSetup
from msrr_control.studies.docking_study import StudyResult, run_docking_study
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.guarded import unguarded
from msrr_scenes.random_streams import stream
from msrr_scenes.registry import is_import_path
from msrr_scenes.specs.spec import Choice

#: Simulated time of a trial [s]; the paper's trajectory reaches the face in 7 s, a slow law in 11 s.
DURATION_S = 14.0


def docking_law(controller: Choice, setup: DockSetup) -> DockingLaw[Any]:
    """Build the array law of a controller.

    Raises:
        SceneError: The controller has no array law, so that it cannot be studied by the thousand.
    """
    built = unguarded(build_controller(controller, setup))
    if not isinstance(built, LawController):
        raise SceneError(
            f"controller {controller.name!r} is not made of an array law; see msrr_control.docking.law"
        )
    return built.law


def with_paper_trajectory(controller: Choice) -> Choice:
    """Return a docking controller that follows the paper's trajectory; one of a user's own stays as it is."""
    if is_import_path(controller):
        return controller
    guidance = {"guidance": PAPER_TRAJECTORY.model_dump()}
    return Choice(name=controller.name, params=merge_params(controller.params, guidance))


def captured(result: StudyResult) -> NDArray[np.bool_]:
    """Return which trials came to the face where the mechanism centres the unit, shape (trials,)."""
    inside = np.zeros(result.contact.shape, dtype=bool)
    lateral, yaw = result.at_contact()
    inside[result.at_face] = (np.abs(lateral) <= CAPTURE_M) & (np.abs(yaw) <= np.radians(CAPTURE_DEG))
    return inside


def run_docking(
    controller: Choice,
    setting: Setting,
    seeds: range,
    duration_s: float = DURATION_S,
    observer: Callable[[Any], None] | None = None,
) -> StudyResult:
    """Run a trial for each seed; starts and noise are the same for every controller.

    They follow from the first seed and the number of seeds, not from each seed: ranges with the same first
    seed share their first starts, and others share nothing, even where they overlap.
    """
    setup = setting.dock_setup()
    law = docking_law(controller, setup)
    rng = stream(seeds.start, f"study/close/{setting.limits}")
    starts, wrong = setting.docking_starts, setting.disturbance
    return run_docking_study(law, setup, rng, len(seeds), starts, wrong, duration_s, observer)


def docking_row(controller: Choice, label: str, setting: Setting, seeds: range) -> Row:
    """Return a controller's row of a table of the close phase."""
    result = run_docking(with_paper_trajectory(controller), setting, seeds)
    paper_values = {"settling": result.settling_time(SETTLED_M), "final": result.final_error()}
    contact, lateral, yaw = np.full((3, len(seeds)), np.nan)
    contact[result.at_face] = result.dt * result.contact[result.at_face]
    lateral[result.at_face], yaw[result.at_face] = np.abs(result.at_contact())
    docked = captured(result)
    within_paper = docked.copy()
    for key, found in paper_values.items():
        within_paper &= found <= (measure(key).paper_c1 or np.inf)
    follows = not np.isnan(result.reference).any()
    values = {**paper_values, "port": result.port_error()}
    values |= {"contact": contact, "lateral": lateral, "yaw": yaw}
    return Row(
        controller=controller.name,
        label=label,
        trials=len(seeds),
        **rates_of(
            success=docked,
            in_view=result.in_cone(setting.scene.cameras.onboard.lens.half_fov),
            in_cone=result.in_cone(setting.dock_setup().los.outer),
        ),
        measures={key: Measured.of(v) for key, v in values.items()},
        met=count_within_paper(paper_values) if follows else {},
        within_paper=int(within_paper.sum()) if follows else None,
    )


def docking_series(controller: Choice, setting: Setting, seed: int) -> Series:
    """Return one trial over time, from start to contact."""
    setup = setting.dock_setup()
    states: list[Any] = []

    result = run_docking_study(
        docking_law(with_paper_trajectory(controller), setup),
        setup,
        stream(seed, "panel/close"),
        1,
        setting.docking_starts,
        setting.disturbance,
        DURATION_S,
        observer=states.append,
    )
    end = int(result.contact[0]) + 1 if result.at_face[0] else len(result.pose)
    tip, reference = result.tip[:end, 0], result.reference[:end, 0]
    follows = not np.isnan(reference).any()
    off = tip - reference if follows else tip * [0.0, 1.0]
    corrected: Array | tuple[()] = ()
    auxiliary = {}
    if isinstance(states[0], CorrectedLawState):
        shift = np.stack([s.cone.shift[0] for s in states[:end]])
        corrected = reference + shift
        auxiliary = {"xi": np.stack([s.xi[0] for s in states[:end]]), "cone shift [m]": shift}
    return Series(
        time=result.dt * np.arange(end),
        tip=tip,
        reference=reference if follows else (),
        corrected=corrected,
        error=np.column_stack([off, result.pose[:end, 0, 2]]),
        command=result.command[:end, 0],
        twist=result.twist[:end, 0],
        angles=result.edges[:end, 0],
        auxiliary=auxiliary,
        limits=(setup.limits.v_close_mps, setup.limits.w_max_radps),
    )
