"""Snapshots of a trial at every decision of the robot, and the verdict on it, read from the log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from msrr_bullet.log import topics
from msrr_bullet.log.reader import Log
from msrr_bullet.log.records import JUDGE, ClearanceRecord, Event, StartPoses, StepStart, TruePose
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    CollisionMonitorState,
    LosObservation,
    Phase,
    PoseEstimate,
)
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

T = TypeVar("T")


def target_frame(scene: Scene, step: DockStep, units: Mapping[str, SE2]) -> SE2:
    """Return the dock frame ``X_WD`` of a step's target, for units at the poses ``X_WU`` given."""
    return units[step.target_unit] @ scene.geometry(step.target_unit).dock_frame(step.target_port)


def read_snapshots(log: Log) -> list[Snapshot]:
    """Return a snapshot of the trial at every decision of the robot, in order."""
    reader = _SnapshotReader(log.header.scene)
    for record in log.records("/truth/*", "/control/*", "/perception/*", topics.STEPS):
        reader.add(record.message)
    reader.finish_instant()
    return reader.snapshots


def read_verdict(log: Log) -> str | None:
    """Return the judge's last verdict in the log; None when the trial did not get that far."""
    verdicts = [event.text for _, event in log.messages(Event, topics.EVENTS) if event.source == JUDGE]
    return verdicts[-1] if verdicts else None


class _SnapshotReader:
    """Groups the messages of a log into snapshots.

    The estimates and the truth of an instant are logged after its decision, so a snapshot is complete only
    when the next decision or the next step of the plan begins.
    """

    def __init__(self, scene: Scene) -> None:
        self.snapshots: list[Snapshot] = []
        self._scene = scene
        self._step: DockStep | None = None
        self._starts: dict[str, SE2] = {}
        self._units: dict[str, SE2] = {}
        self._path: AssemblyPath | None = None
        self._action: Action | None = None
        self._latest: dict[type, object] = {}

    def add(self, message: object) -> None:
        if isinstance(message, Action):
            self.finish_instant()
            self._action = message
            self._latest.clear()
        elif isinstance(message, AssemblyPath):
            self._path = message
        elif isinstance(message, TruePose):
            self._units[message.name] = message.X_WB
        elif isinstance(message, StartPoses):
            self._starts = message.poses
            self._units = {name: message.poses[name] for name in self._scene.units}
        elif isinstance(message, StepStart):
            self.finish_instant()
            self._path = None
            self._step = self._scene.plan[message.index]
        else:
            self._latest[type(message)] = message

    def finish_instant(self) -> None:
        action, self._action = self._action, None
        if action is None:
            return
        estimate, situation = self._get(PoseEstimate), self._get(ArenaEstimate)
        clearance = self._get(ClearanceRecord)
        believed = None
        if action.phase is Phase.ASSEMBLE and situation is not None:
            believed = situation.own.X_WB
        elif self._step is not None and estimate is not None:
            believed = target_frame(self._scene, self._step, self._units) @ estimate.X_DU
        self.snapshots.append(
            Snapshot(
                stamp_ns=action.stamp_ns,
                units=dict(self._units),
                obstacles=self._obstacles(action.stamp_ns),
                step=self._step,
                estimate=believed,
                phase=action.phase,
                attempt=action.attempt,
                los=self._get(LosObservation),
                clearance=clearance.clearance if clearance else None,
                twist=action.twist,
                reason=action.reason,
                situation=situation,
                monitor=self._get(CollisionMonitorState),
                assembly=self._get(AssemblyProgress),
                path=self._path,
            )
        )

    def _get(self, kind: type[T]) -> T | None:
        message = self._latest.get(kind)
        return message if isinstance(message, kind) else None

    def _obstacles(self, stamp_ns: int) -> dict[str, SE2]:
        return {
            name: self._starts[name]
            for name, spec in self._scene.obstacles.items()
            if name in self._starts and spec.appears_at_s * 1e9 <= stamp_ns
        }
