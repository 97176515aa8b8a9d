"""Snapshots of a trial at every decision of the robot, and the verdict on it, read from the log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from msrr_bullet.log import topics
from msrr_bullet.log.reader import Log
from msrr_bullet.log.records import JUDGE, ClearanceRecord, Event, StartPoses, StepStart, TruePose
from msrr_bullet.timeline.snapshot import Snapshot, StepSnapshot
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
from msrr_scenes.outcome import Outcome
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
        reader.add(record.topic, record.message)
    reader.finish_instant()
    return reader.snapshots


def read_verdict(log: Log) -> str | None:
    """Return the judge's verdict on the trial; None when the trial did not get that far."""
    outcomes = {outcome.value for outcome in Outcome}
    events = (event for _, event in log.messages(Event, topics.EVENTS) if event.source == JUDGE)
    return next((event.text for event in reversed(list(events)) if event.text in outcomes), None)


class _SnapshotReader:
    """Groups the messages of a log into snapshots, one for every instant at which robots decided.

    The estimates and the truth of an instant are logged after the decisions, so a snapshot is complete only
    when the decisions of the next instant or the next step of the plan begin.
    """

    def __init__(self, scene: Scene) -> None:
        self.snapshots: list[Snapshot] = []
        self._scene = scene
        self._steps: dict[str, DockStep] = {}  # by unit
        self._starts: dict[str, SE2] = {}
        self._units: dict[str, SE2] = {}
        self._paths: dict[str, AssemblyPath] = {}
        self._actions: dict[str, Action] = {}
        self._latest: dict[tuple[str, type], object] = {}
        self._clearance: ClearanceRecord | None = None

    def add(self, topic: str, message: object) -> None:
        if isinstance(message, Action):
            if any(action.stamp_ns != message.stamp_ns for action in self._actions.values()):
                self.finish_instant()
            self._actions[topics.unit_of(topic)] = message
        elif isinstance(message, AssemblyPath):
            self._paths[topics.unit_of(topic)] = message
        elif isinstance(message, TruePose):
            self._units[message.name] = message.X_WB
        elif isinstance(message, StartPoses):
            self._starts = message.poses
            self._units = {name: message.poses[name] for name in self._scene.units}
        elif isinstance(message, StepStart):
            self.finish_instant()
            self._paths.pop(message.unit, None)
            self._steps.pop(message.unit, None)
            self._steps[message.unit] = message.step(self._scene)
        elif isinstance(message, ClearanceRecord):
            self._clearance = message
        else:
            self._latest[topics.unit_of(topic), type(message)] = message

    def finish_instant(self) -> None:
        actions, self._actions = self._actions, {}
        latest, self._latest = self._latest, {}
        clearance, self._clearance = self._clearance, None
        if not actions:
            return
        stamp_ns = max(action.stamp_ns for action in actions.values())
        self.snapshots.append(
            Snapshot(
                stamp_ns=stamp_ns,
                units=dict(self._units),
                obstacles=self._obstacles(stamp_ns),
                clearance=clearance.clearance if clearance else None,
                steps=tuple(
                    self._step(step, actions[unit], latest)
                    for unit, step in self._steps.items()
                    if unit in actions
                ),
            )
        )

    def _step(
        self, step: DockStep, action: Action, latest: Mapping[tuple[str, type], object]
    ) -> StepSnapshot:
        def get(kind: type[T]) -> T | None:
            message = latest.get((step.unit, kind))
            return message if isinstance(message, kind) else None

        estimate, situation = get(PoseEstimate), get(ArenaEstimate)
        believed = None
        if action.phase is Phase.ASSEMBLE and situation is not None:
            believed = situation.own.X_WB
        elif estimate is not None:
            believed = target_frame(self._scene, step, self._units) @ estimate.X_DU
        return StepSnapshot(
            step=step,
            estimate=believed,
            phase=action.phase,
            attempt=action.attempt,
            los=get(LosObservation),
            twist=action.twist,
            reason=action.reason,
            situation=situation,
            monitor=get(CollisionMonitorState),
            assembly=get(AssemblyProgress),
            path=self._paths.get(step.unit),
        )

    def _obstacles(self, stamp_ns: int) -> dict[str, SE2]:
        return {
            name: self._starts[name]
            for name, spec in self._scene.obstacles.items()
            if name in self._starts and spec.appears_at_s * 1e9 <= stamp_ns
        }
