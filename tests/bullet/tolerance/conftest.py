"""Studies whose trials follow a law that is written down here, so that what they have to find is known."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from msrr_bullet.tolerance.effects import Effect, effects_of, select_effects
from msrr_bullet.tolerance.model import ToleranceStudy
from msrr_bullet.tolerance.study import tolerance_study
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.step_result import AttemptRecord, Contact, PlanarPose, StepResult
from msrr_scenes import scene_hash
from msrr_scenes.messages import Phase
from msrr_scenes.outcome import Outcome
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene
from tests.bullet.conftest import inline


class Law:
    """The law of the made-up trials.

    Attributes:
        mm_per_deg: Lateral error per degree of camera yaw, which pushes to one side.
        mm_per_percent: Lateral error per percent of a wheel's radius, which pushes to a side that depends on
            the start.
        docks_to_deg: Largest camera yaw at which a trial docks.
    """

    mm_per_deg, mm_per_percent, docks_to_deg = 2.7, 0.3, 1.37

    def __call__(self, scene: Scene, seed: int) -> TrialResult:
        """Run a trial; a :data:`msrr_bullet.sweep.worker_pool.TrialFunction`."""
        own_mm = 0.05 * float(stream(seed, "own").standard_normal())
        yaw = scene.as_built.onboard.yaw_deg.error or 0.0
        wheel = scene.as_built.drive.radius_left_percent.error or 0.0
        side = 1.0 if stream(seed, "side").random() < 0.5 else -1.0
        lateral_mm = own_mm + self.mm_per_deg * yaw + side * self.mm_per_percent * wheel
        outcome = Outcome.DOCKED if abs(yaw) <= self.docks_to_deg else Outcome.FALSE_ABORT
        return made_up(scene, seed, outcome, 1e-3 * lateral_mm, math.radians(0.1 * yaw))


def made_up(scene: Scene, seed: int, outcome: Outcome, lateral_m: float, yaw_rad: float) -> TrialResult:
    """Return the result of a trial with one dock and these errors at contact."""
    port = PlanarPose(x_m=-0.01, y_m=lateral_m, yaw_rad=yaw_rad)
    contact = Contact(time_s=1.0, lateral_m=abs(lateral_m), yaw_rad=abs(yaw_rad), port=port)
    attempt = AttemptRecord(
        ended_s=2.0, phase=Phase.DONE, reason="made up", contact=contact, believed=None, true=port
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
        attempts=(attempt,),
    )
    return TrialResult(
        scene=scene.name,
        scene_hash=scene_hash(scene),
        seed=seed,
        plant=scene.plant,
        perception=scene.perception,
        outcome=outcome,
        reason="made up",
        duration_s=2.0,
        steps=(step,),
    )


@pytest.fixture(scope="session")
def scene(shipped: Callable[..., Scene]) -> Scene:
    return shipped("close_range", blind=True)


@pytest.fixture(scope="session")
def effects(scene: Scene) -> tuple[Effect, ...]:
    return effects_of(scene)


@pytest.fixture(scope="session")
def law() -> Law:
    return Law()


@pytest.fixture(scope="session")
def study(law: Law, scene: Scene, effects: tuple[Effect, ...]) -> ToleranceStudy:
    """A study of the law, with the effects that it knows and one that it does not."""
    names = ["onboard.yaw_deg", "drive.radius_left_percent", "drive.track_percent"]
    return tolerance_study(
        scene,
        select_effects(effects, names),
        ["perfect", "careful"],
        seeds=range(20),
        grade_seeds=range(5),
        executor=inline,
        trial=law,
    )
