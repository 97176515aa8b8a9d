"""One trial: the steps of the plan of a scene, and the result."""

from __future__ import annotations

from collections.abc import Callable

from msrr_bullet.log.recorder import NullRecorder, Recorder
from msrr_bullet.profiler import NullProfiler, Profiler
from msrr_bullet.timeline.snapshot import Viewer
from msrr_bullet.trial.environment import Environment, open_environment
from msrr_bullet.trial.mission import MissionLoop, PlannedMission
from msrr_bullet.trial.result import TrialResult
from msrr_bullet.trial.telemetry import Progress, Telemetry
from msrr_bullet.trial.verdict import verdict_on_trial
from msrr_bullet.wall_limit import within_wall_limit
from msrr_scenes.errors import ChangedFileError
from msrr_scenes.loading.load import scene_hash
from msrr_scenes.messages import seconds
from msrr_scenes.specs.scene import Scene


class Trial:
    """One trial of a scene with a seed, without a run folder; see :func:`msrr_bullet.run.run_trial`."""

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
        """Prepare a trial of a scene that :func:`msrr_bullet.trial.check.check_trial` accepts.

        Scene, seed and versions determine every bit of the log. Viewer and observer are called at every
        control instant.
        """
        self.scene = scene
        self.seed = seed
        self._telemetry = Telemetry(recorder or NullRecorder(), scene, viewer, observer)
        self._profiler = profiler or NullProfiler()

    def run(self, wall_limit_s: float | None = None) -> TrialResult:
        """Run the trial and return the result.

        ``wall_limit_s`` is the time that it may take on the wall clock; None sets no limit.

        Raises:
            WallLimitError: The trial took longer.
            ChangedFileError: A file of the scene was written while the trial ran.
        """
        return within_wall_limit(wall_limit_s, self._run)

    def _run(self, check_clock: Callable[[], None]) -> TrialResult:
        digest = scene_hash(self.scene)
        with open_environment(self.scene, self.seed) as environment:
            self._telemetry.begin(environment.simulation)
            mission = begin_mission(environment, self._telemetry, self._profiler)
            mission.run(check_clock)
            if scene_hash(self.scene) != digest:
                raise ChangedFileError(
                    f"{self.scene.name}, seed {self.seed}: while the trial ran, a URDF, mesh or texture was "
                    "written, or a class of your own wrote into the scene; it counts for neither version. "
                    "Let nothing write into them, and run it again"
                )
            result = self._result(digest, mission, environment.simulation.placement.redraws)
            self._telemetry.end(environment.simulation.plant.now_ns(), result.outcome)
        return result

    def _result(self, digest: str, mission: MissionLoop, redraws: int) -> TrialResult:
        steps = mission.results()
        verdict = verdict_on_trial(mission.ended, steps, mission.failed_lock)
        return TrialResult(
            scene=self.scene.name,
            scene_hash=digest,
            seed=self.seed,
            plant=self.scene.plant,
            perception=self.scene.perception,
            as_built=str(self.scene.as_built),
            outcome=verdict.outcome,
            reason=verdict.reason,
            duration_s=seconds(mission.ended_ns),
            start_redraws=redraws,
            steps=steps,
            mission=mission.figures(),
        )


def begin_mission(environment: Environment, telemetry: Telemetry, profiler: Profiler) -> MissionLoop:
    """Begin what the scene of an environment asks for: a plan, or the mission of a base station."""
    if not environment.simulation.scene.coordinated:
        return PlannedMission(environment, telemetry, profiler)
    # The other scenes, and their checks, do without the base station, which is twenty modules.
    from msrr_bullet.trial.coordinated_mission import CoordinatedMission

    return CoordinatedMission(environment, telemetry, profiler)
