"""Trials that take no time: made-up results, and a short real trial."""

import math
from collections.abc import Callable
from functools import partial

import pytest

from msrr_bullet.sweep.summary import SweepSummary
from msrr_bullet.sweep.sweep import run_sweep
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.step_result import AttemptRecord, Contact, PlanarPose, Seating, StepResult
from msrr_scenes import load_scene, scene_hash
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import inline


@pytest.fixture(scope="session")
def scene() -> Scene:
    return load_scene("close_range")


@pytest.fixture(scope="session")
def short_trial() -> dict[str, str]:
    """Overrides for a real trial that takes no time: no contact, no pixels, one simulated second."""
    return {"plant": "unicycle", "perception": "parametric", "time_limit_s": "1"}


def made_up(scene: Scene, seed: int) -> TrialResult:
    """Dock on the first attempt with even seeds and the second with odd ones; every tenth is a false dock."""
    false_dock = seed % 10 == 9
    outcome = Outcome.FALSE_DOCK if false_dock else Outcome.DOCKED
    lateral, yaw = 1e-3 * seed, math.radians(0.1 * seed)
    port = PlanarPose(x_m=-0.01, y_m=-lateral, yaw_rad=yaw)
    contact = Contact(time_s=0.5, lateral_m=lateral, yaw_rad=yaw, port=port)
    attempt = AttemptRecord(
        ended_s=1.0,
        phase=Phase.DONE,
        reason="made up",
        contact=None if false_dock else contact,
        believed=None,
        true=PlanarPose(x_m=-0.1, y_m=0.0, yaw_rad=0.0),
    )
    step = StepResult(
        index=0,
        unit="a",
        port="front",
        target="b.rear",
        outcome=outcome,
        belief="docked",
        belief_reason="made up",
        started_s=0.0,
        attempts=(attempt,) * (1 + seed % 2),
        seating=Seating(axial_gap_m=0.001, lateral_m=0.0, yaw_rad=0.0, seated=not false_dock),
        min_clearance_m=0.3 - 0.01 * seed,
    )
    return TrialResult(
        scene=scene.name,
        scene_hash=scene_hash(scene),
        seed=seed,
        plant=scene.plant,
        perception=scene.perception,
        outcome=outcome,
        reason="made up",
        duration_s=1.0,
        start_redraws=seed % 3,
        steps=(step,),
    )


@pytest.fixture
def made_up_sweep(scene: Scene) -> Callable[..., SweepSummary]:
    """A sweep of made-up trials in this process."""
    return partial(run_sweep, scene, executor=inline, trial=made_up)
