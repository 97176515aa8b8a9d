"""The paper's Fig. 6 with C1 and C2 over each other, on unicycles and in the real loop."""

from __future__ import annotations

import numpy as np

from msrr_bullet.reproduce.trial_series import DockingSeries, SeriesRecorder
from msrr_bullet.studies.docking_studies import docking_series, with_paper_trajectory
from msrr_bullet.studies.gain_delay import C1, delayed, law_at
from msrr_bullet.studies.labels import C2
from msrr_bullet.studies.series import Figure6, Series
from msrr_scenes.errors import MsrrError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene


def unicycle_figure6(seed: int, cell: tuple[float, float]) -> Figure6:
    """Run one trial of each law on a unicycle, at a gain [1/s] and a latency [s]."""
    gain, latency = cell
    setting = delayed(latency, compensated=False)
    return Figure6(
        plant="unicycle",
        description=f"gain {gain:g} 1/s, {setting.description('close')}",
        series={label: docking_series(law_at(label, gain), setting, seed) for label in (C1, C2)},
    )


def bullet_figure6(seed: int, cell: tuple[float, float], replaced: dict[str, str] | None = None) -> Figure6:
    """Run the first approach of each law with contact and images, on the paper's trajectory as well.

    ``cell`` is gain [1/s] and latency [s]; ``replaced`` are more values of the scene to override, such as a
    plant without contact.

    Raises:
        MsrrError: The shipped scene never came to an approach.
    """
    # A process that only draws figures does not load the simulator.
    from msrr_bullet.trial.trial import Trial

    gain, latency = cell
    scene_name = "close_range"
    series = {}
    for label in (C1, C2):
        controller = with_paper_trajectory(law_at(label, gain))
        overrides = {
            "as_built": "perfect",
            **(replaced or {}),
            "control.docking": controller.model_dump_json(),
            "cameras.onboard.latency_ms": f"{1e3 * latency:g}",
            "control.delay_compensation": "false",
        }
        scene = load_scene(scene_name, overrides)
        recorder = SeriesRecorder(scene.docks[-1].unit)
        contact = Trial(scene, seed, recorder=recorder).run().steps[-1].attempts[0].contact
        first = [i for i in recorder.instants if i.action.attempt == recorder.instants[0].action.attempt]
        approach = DockingSeries.of(first, scene, contact.time_s if contact is not None else None)
        if approach is None:
            raise MsrrError(f"{scene_name}, seed {seed}, {label}: no approach was begun")
        series[label] = _as_series(approach, scene)
    return Figure6(
        plant="bullet",
        description=f"scene {scene_name}, gain {gain:g} 1/s, {1e3 * latency:g} ms that the estimator does not"
        " compensate for, the paper's trajectory, perfect calibration",
        series=series,
    )


def _as_series(approach: DockingSeries, scene: Scene) -> Series:
    return Series(
        time=approach.time,
        tip=approach.tip,
        reference=approach.reference,
        corrected=approach.corrected,
        error=np.column_stack([approach.tip - approach.reference, approach.pose[:, 2]]),
        command=approach.command,
        twist=approach.twist,
        limits=(scene.limits.v_close_mps, scene.limits.w_max_radps),
    )
