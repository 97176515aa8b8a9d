"""The outputs of a running trial: truth and events for the log, snapshots for a viewer, progress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.log import topics
from msrr_bullet.log.recorder import Recorder
from msrr_bullet.log.records import JUDGE, ClearanceRecord, Event, Level, StartPoses, TruePose
from msrr_bullet.robot.interface import ObservableRobot
from msrr_bullet.simulation.simulation import Simulation
from msrr_bullet.timeline.snapshot import Snapshot, Viewer
from msrr_bullet.trial.environment import Environment
from msrr_bullet.trial.judge import Judge
from msrr_perception.estimation.global_estimator import pose_in_dock_frame
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Action, Phase, seconds
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.plan import DockStep


@dataclass(frozen=True, slots=True)
class Progress:
    """The state of a running trial at one control instant, for progress displays.

    Attributes:
        time_s: Simulated time [s].
        phase: Phase of the robot.
        attempt: Number of the attempt, from 1.
        step: Index of the step in the plan, from 0.
        believed: Estimate X_DU; None without an estimate.
        true: True X_DU; None before the first step.
        reason: Reason for entering the phase.
    """

    time_s: float
    phase: Phase
    attempt: int
    step: int = 0
    believed: SE2 | None = None
    true: SE2 | None = None
    reason: str = ""


class Telemetry:
    """Writes the reports of a trial. Nothing of them reaches the robot.

    Attributes:
        recorder: Gets every message.
    """

    def __init__(
        self,
        recorder: Recorder,
        viewer: Viewer | None = None,
        observer: Callable[[Progress], None] | None = None,
    ) -> None:
        """Report to a recorder and, where given, to a viewer and to an observer."""
        self.recorder = recorder
        self._viewer = viewer
        self._observer = observer
        self._last_action: Action | None = None

    def begin(self, placement: Placement) -> None:
        """Record the start poses of all bodies."""
        poses = {**placement.units, **placement.obstacles}
        self.recorder.write(topics.STARTS, 0, StartPoses(placement.redraws, poses))

    def report(
        self,
        environment: Environment,
        index: int,
        judge: Judge,
        robot: ObservableRobot,
        action: Action,
        nearest: Clearance | None,
    ) -> None:
        """Report one control instant.

        Args:
            environment: The environment of the trial.
            index: Index of the step in the plan.
            judge: The judge of the step.
            robot: The robot after the decision.
            action: Action of the robot.
            nearest: Smallest true clearance of all pairs that may not touch; None without such a pair.
        """
        simulation = environment.simulation
        step = simulation.scene.plan[index]
        poses = simulation.poses()
        for unit in simulation.scene.units:
            true = TruePose(unit, action.stamp_ns, poses[unit])
            self.recorder.write(topics.true_pose(unit), action.stamp_ns, true)
        if nearest is not None:
            record = ClearanceRecord.of(action.stamp_ns, nearest)
            self.recorder.write(topics.CLEARANCE, action.stamp_ns, record)
        last, self._last_action = self._last_action, action
        if last is None or (last.phase, last.attempt) != (action.phase, action.attempt):
            text = f"attempt {action.attempt}: {action.phase.value}: {action.reason}"
            self.event(action.stamp_ns, step.unit, text)
        believed = robot.estimate.X_DU if robot.estimate else None
        if action.phase is Phase.ASSEMBLE and robot.arena is not None:
            believed = pose_in_dock_frame(robot.arena, judge.X_TD)
        if self._observer is not None:
            now_s = seconds(action.stamp_ns)
            self._observer(
                Progress(now_s, action.phase, action.attempt, index, believed, judge.X_DU(), action.reason)
            )
        if self._viewer is not None:
            estimate = judge.X_WD() @ believed if believed else None
            self._viewer.update(_snapshot(simulation, step, poses, estimate, robot, action, nearest))

    def verdict(self, stamp_ns: int, outcome: Outcome) -> None:
        """Record the verdict on a step."""
        level = Level.INFO if outcome is Outcome.DOCKED else Level.WARNING
        self.event(stamp_ns, JUDGE, outcome.value, level)

    def event(self, stamp_ns: int, source: str, text: str, level: Level = Level.INFO) -> None:
        """Record an event of ``source``, described by one line of text."""
        self.recorder.write(topics.EVENTS, stamp_ns, Event(stamp_ns, source, text, level))


def _snapshot(
    simulation: Simulation,
    step: DockStep,
    poses: dict[str, SE2],
    estimate: SE2 | None,
    robot: ObservableRobot,
    action: Action,
    nearest: Clearance | None,
) -> Snapshot:
    return Snapshot(
        stamp_ns=action.stamp_ns,
        units={unit: poses[unit] for unit in simulation.scene.units},
        obstacles={name: X for name, X in poses.items() if name in simulation.scene.obstacles},
        step=step,
        estimate=estimate,
        phase=action.phase,
        attempt=action.attempt,
        los=robot.los,
        clearance=nearest,
        twist=action.twist,
        reason=action.reason,
        situation=robot.arena,
        monitor=robot.monitor,
        assembly=robot.assembly,
        path=robot.path,
    )
