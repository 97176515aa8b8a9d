"""The close-range phase on unicycles: a controller in a setting, as a row of a table or over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msrr_bullet.studies.measures import CAPTURE_DEG, CAPTURE_M, SETTLED_M, measure
from msrr_bullet.studies.model import Measured, Row, Series, met_of, rate_of
from msrr_bullet.studies.settings import PAPER_TRAJECTORY, Setting
from msrr_control.docking.c1 import C1DockingState
from msrr_control.docking.controller import LawController, build_controller
from msrr_control.docking.law import DockingLaw, DockSetup
from msrr_control.studies.docking_study import StudyResult, run_study
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.spec import Choice

#: Simulated time of a trial [s]; the paper's trajectory reaches the face in 7, a slow law in 11.
DURATION = 14.0


def docking_law(controller: Choice, setup: DockSetup) -> DockingLaw[Any]:
    """Build the array law behind a controller.

    Raises:
        SceneError: It has none, so that it cannot be studied by the thousand.
    """
    built = build_controller(controller, setup)
    if not isinstance(built, LawController):
        raise SceneError(
            f"controller {controller.name!r} is not made of an array law; see msrr_control.docking.law"
        )
    return built.law


def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Return nested parameters with others laid over them."""
    out = dict(base)
    for key, value in over.items():
        here = out.get(key)
        out[key] = merged(here, value) if isinstance(here, dict) and isinstance(value, dict) else value
    return out


def on_paper_trajectory(controller: Choice) -> Choice:
    """Return a docking controller that follows the paper's trajectory."""
    guidance = {"guidance": PAPER_TRAJECTORY.model_dump()}
    return Choice(name=controller.name, params=merged(controller.params, guidance))


def captured(result: StudyResult) -> NDArray[np.bool_]:
    """Say which trials came to the face where the mechanism centres them, shape (trials,)."""
    good = np.zeros(result.contact.shape, dtype=bool)
    lateral, yaw = result.at_contact()
    good[result.docked] = (np.abs(lateral) <= CAPTURE_M) & (np.abs(yaw) <= np.radians(CAPTURE_DEG))
    return good


def run_close(controller: Choice, setting: Setting, seeds: range, duration: float = DURATION) -> StudyResult:
    """Study a controller: a trial for each seed; starts and noise are the same for every controller."""
    setup = setting.dock_setup()
    law = docking_law(controller, setup)
    rng = stream(seeds.start, f"study/close/{setting.limits}")
    return run_study(law, setup, rng, len(seeds), setting.starts, setting.disturbance, duration)


def close_row(controller: Choice, label: str, setting: Setting, seeds: range) -> Row:
    """Return a controller's row of a table of the close phase."""
    result = run_close(on_paper_trajectory(controller), setting, seeds)
    settled, final = result.settling_time(SETTLED_M), result.final_error()
    lateral, yaw = result.at_contact()
    caught = captured(result)
    met = np.array(caught)
    for what, values in (("settling", settled), ("final", final)):
        met &= values <= (measure(what).paper_c1 or np.inf)
    return Row(
        controller=controller.name,
        label=label,
        trials=len(seeds),
        success=rate_of(caught),
        in_view=rate_of(result.in_cone(setting.half_fov)),
        in_cone=rate_of(result.in_cone(setting.dock_setup().los.outer)),
        measures={
            "settling": Measured.of(settled),
            "final": Measured.of(final),
            "lateral": Measured.of(np.abs(lateral)),
            "yaw": Measured.of(np.abs(yaw)),
        },
        met=met_of({"settling": settled, "final": final}),
        within_paper=int(met.sum()),
    )


def close_series(controller: Choice, setting: Setting, seed: int) -> Series:
    """Return one trial over time, from start to contact."""
    controller = on_paper_trajectory(controller)
    setup = setting.dock_setup()
    states: list[C1DockingState] = []

    def keep(state: object) -> None:
        if isinstance(state, C1DockingState):
            states.append(state)

    result = run_study(
        docking_law(controller, setup),
        setup,
        stream(seed, "panel/close"),
        1,
        setting.starts,
        setting.disturbance,
        DURATION,
        observer=keep,
    )
    end = int(result.contact[0]) + 1 if result.docked[0] else len(result.pose)
    gap = result.tip[:end, 0] - result.reference[:end, 0]
    error = np.column_stack([gap, result.pose[:end, 0, 2]])
    auxiliary = {}
    if states:
        auxiliary = {
            "xi": pairs(np.stack([s.xi[0] for s in states[:end]])),
            "cone shift [m]": pairs(np.stack([s.cone.shift[0] for s in states[:end]])),
        }
    return Series(
        time=tuple(round(result.dt * k, 6) for k in range(end)),
        tip=pairs(result.tip[:end, 0]),
        reference=pairs(result.reference[:end, 0]),
        error=tuple((float(x), float(y), float(t)) for x, y, t in np.round(error, 6)),
        command=pairs(result.command[:end, 0]),
        twist=pairs(result.twist[:end, 0]),
        angles=pairs(result.edges[:end, 0]),
        auxiliary=auxiliary,
        limits=(setup.limits.v_close_mps, setup.limits.w_max_radps),
    )


def pairs(values: Array) -> tuple[tuple[float, float], ...]:
    """Return an array of shape (N, 2) as pairs, to the micrometre."""
    return tuple((float(a), float(b)) for a, b in np.round(values, 6))
