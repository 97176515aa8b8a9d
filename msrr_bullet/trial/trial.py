"""One trial: the plan of a scene, step by step, and the verdict."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.log.recorder import NullRecorder, Recorder
from msrr_bullet.profiler import NullProfiler, Profiler
from msrr_bullet.timeline.snapshot import Viewer
from msrr_bullet.trial import result
from msrr_bullet.trial.docking_step import DockingStep, StepResult
from msrr_bullet.trial.environment import open_environment
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.telemetry import Progress, Telemetry
from msrr_control.staging.feasibility import check_assembly
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.messages import Conviction, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement.placement import draw_placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene

_BELIEFS: dict[Conviction, result.Belief] = {
    Conviction.DOCKED: "docked",
    Conviction.GAVE_UP: "gave_up",
}


class Trial:
    """Runs one scene with one seed. Use :func:`msrr_bullet.run.run_trial` unless you want the parts."""

    def __init__(
        self,
        scene: Scene,
        seed: int,
        *,
        recorder: Recorder | None = None,
        viewer: Viewer | None = None,
        observer: Callable[[Progress], None] | None = None,
        profiler: Profiler | None = None,
    ) -> None:
        """Prepare a trial.

        Args:
            scene: The scene.
            seed: Seed of all random streams; scene and seed determine every bit of the log.
            recorder: Gets every message.
            viewer: Gets a snapshot at every control instant.
            observer: Called with the progress at every control instant.
            profiler: Measures the time of each stage of the loop.

        Raises:
            SceneError: The long-distance phase cannot work in this scene.
        """
        check_assembly(scene)
        self.scene = scene
        self.seed = seed
        self._telemetry = Telemetry(recorder or NullRecorder(), viewer, observer)
        self._profiler = profiler or NullProfiler()

    def run(self) -> TrialResult:
        """Run the trial to its end and return the verdict."""
        placement = draw_placement(self.scene, lambda name: stream(self.seed, name))
        self._telemetry.begin(placement)
        ends: list[StepResult] = []
        with open_environment(self.scene, self.seed, placement) as environment:
            for index, step in enumerate(self.scene.plan):
                end = DockingStep(environment, index, self._telemetry, self._profiler).run()
                ends.append(end)
                if end.outcome is not Outcome.DOCKED:
                    break
                environment.locked.add(step)
        return self._result(ends, placement.redraws)

    def _result(self, ends: list[StepResult], redraws: int) -> TrialResult:
        last = ends[-1]
        clearances = [e.min_clearance_m for e in ends if e.min_clearance_m is not None]
        return TrialResult(
            scene=self.scene.name,
            scene_hash=scene_hash(self.scene),
            seed=self.seed,
            plant=self.scene.plant,
            perception=self.scene.perception,
            outcome=last.outcome,
            belief=_BELIEFS.get(last.belief.conviction, "undecided"),
            belief_reason=last.belief.reason or last.action.reason,
            attempts=sum(e.action.attempt for e in ends),
            duration_s=seconds(last.action.stamp_ns),
            phase=last.action.phase,
            contact=last.contact,
            seating=last.seating,
            lock_closed=last.lock_closed,
            lock_engaged=last.lock_engaged,
            pull_test_passed=last.pull_test_passed,
            min_clearance_m=min(clearances, default=None),
            assembly=last.assembly,
            start_redraws=redraws,
            records=tuple(record for e in ends for record in e.records),
        )
