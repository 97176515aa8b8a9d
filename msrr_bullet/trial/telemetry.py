"""Tells a trial as it happens: truth and events to the log, snapshots to a viewer, progress to a person."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from msrr_bullet.collision.clearance_model import Clearance
from msrr_bullet.log import topics
from msrr_bullet.log.recorder import Recorder
from msrr_bullet.log.records import JUDGE, Event, Level, StartPoses, TruePose
from msrr_bullet.log.records import Clearance as ClearanceRecord
from msrr_bullet.timeline.snapshot import Snapshot, Viewer
from msrr_bullet.trial.environment import Stage
from msrr_bullet.trial.judge import Judge
from msrr_bullet.trial.progress import Progress
from msrr_perception.estimation.global_estimator import X_DU
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    LosObservation,
    Phase,
    PoseEstimate,
    seconds,
)
from msrr_scenes.outcome import Outcome
from msrr_scenes.placement.placement import Placement
from msrr_scenes.specs.plan import DockStep


class Believer(Protocol):
    """What is told of the robot."""

    @property
    def estimate(self) -> PoseEstimate | None:
        """Belief on which the last decision was taken."""
        ...

    @property
    def situation(self) -> ArenaEstimate | None:
        """What global localisation knew when the last decision was taken."""
        ...

    @property
    def los(self) -> LosObservation | None:
        """Line of sight on which the last decision was taken."""
        ...

    @property
    def assembly(self) -> AssemblyProgress | None:
        """What the long-distance phase did; None when it is not at work."""
        ...

    @property
    def path(self) -> AssemblyPath | None:
        """The path that the long-distance phase follows."""
        ...


class Telemetry:
    """Everything a trial says to the outside; nothing it does reaches the robot."""

    def __init__(
        self,
        recorder: Recorder,
        viewer: Viewer | None = None,
        observer: Callable[[Progress], None] | None = None,
    ) -> None:
        """Tell the log, a viewer if there is one, and an observer if there is one."""
        self.recorder = recorder
        self._viewer = viewer
        self._observer = observer
        self._told: Action | None = None

    def begin(self, placement: Placement) -> None:
        """Record where everything was set down."""
        poses = {**placement.units, **placement.obstacles}
        self.recorder.write(topics.STARTS, 0, StartPoses(placement.redraws, poses))

    def instant(
        self,
        stage: Stage,
        index: int,
        step: DockStep,
        judge: Judge,
        robot: Believer,
        action: Action,
        nearest: Clearance | None,
    ) -> None:
        """Tell one control instant, after the decision."""
        poses = stage.poses()
        for unit in stage.scene.units:
            true = TruePose(unit, action.stamp_ns, poses[unit])
            self.recorder.write(topics.true_pose(unit), action.stamp_ns, true)
        if nearest is not None:
            self._record_clearance(action.stamp_ns, nearest, nearest.pair in stage.bonds)
        before, self._told = self._told, action
        if before is None or (before.phase, before.attempt) != (action.phase, action.attempt):
            text = f"attempt {action.attempt}: {action.phase.value}: {action.reason}"
            self.event(action.stamp_ns, step.unit, text)
        believed = robot.estimate.X_DU if robot.estimate else None
        if action.phase is Phase.ASSEMBLE and robot.situation is not None:
            believed = X_DU(robot.situation, judge.X_TD)
        if self._observer is not None:
            now_s = seconds(action.stamp_ns)
            self._observer(
                Progress(now_s, action.phase, action.attempt, index, believed, judge.X_DU(), action.reason)
            )
        if self._viewer is not None:
            self._viewer.update(
                self._snapshot(stage, step, poses, judge.X_WD(), believed, robot, action, nearest)
            )

    def verdict(self, stamp_ns: int, outcome: Outcome) -> None:
        """Tell how a step ended."""
        level = Level.INFO if outcome is Outcome.DOCKED else Level.WARNING
        self.event(stamp_ns, JUDGE, outcome.value, level)

    def event(self, stamp_ns: int, source: str, text: str, level: Level = Level.INFO) -> None:
        """Record something worth a line."""
        self.recorder.write(topics.EVENTS, stamp_ns, Event(stamp_ns, source, text, level))

    def _record_clearance(self, stamp_ns: int, nearest: Clearance, exempt: bool) -> None:
        points = np.array([nearest.point_a, nearest.point_b])
        record = ClearanceRecord(stamp_ns, (nearest.body_a, nearest.body_b), nearest.distance, points, exempt)
        self.recorder.write(topics.CLEARANCE, stamp_ns, record)

    @staticmethod
    def _snapshot(
        stage: Stage,
        step: DockStep,
        poses: dict[str, SE2],
        X_WD: SE2,
        believed: SE2 | None,
        robot: Believer,
        action: Action,
        nearest: Clearance | None,
    ) -> Snapshot:
        return Snapshot(
            stamp_ns=action.stamp_ns,
            units={unit: poses[unit] for unit in stage.scene.units},
            obstacles={name: X for name, X in poses.items() if name in stage.scene.obstacles},
            step=step,
            estimate=X_WD @ believed if believed else None,
            phase=action.phase,
            attempt=action.attempt,
            los=robot.los,
            clearance=nearest,
            twist=action.twist,
            reason=action.reason,
            situation=robot.situation,
            assembly=robot.assembly,
            path=robot.path,
        )
