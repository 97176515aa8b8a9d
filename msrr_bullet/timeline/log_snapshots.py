"""Tells a trial again from its log: the instants that viewer and picture show."""

from __future__ import annotations

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.log import topics
from msrr_bullet.log.reader import Log
from msrr_bullet.log.records import JUDGE, Event, StartPoses, StepStart, TruePose
from msrr_bullet.log.records import Clearance as ClearanceRecord
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    Action,
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    LosObservation,
    Phase,
    PoseEstimate,
)
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


def dock_frame(scene: Scene, step: DockStep, units: dict[str, SE2]) -> SE2:
    """Return ``X_WD`` of a step's target, the units being where ``units`` says."""
    return units[step.target_unit] @ scene.geometry(step.target_unit).dock_frame(step.target_port)


def snapshots(log: Log) -> list[Snapshot]:
    """Return the trial at every decision of the robot, in order."""
    scene = log.header.scene
    frames: list[Snapshot] = []
    starts: dict[str, SE2] = {}
    step: DockStep | None = None
    now: dict[type, object] = {}
    units: dict[str, SE2] = {}

    path: AssemblyPath | None = None

    def close(action: Action) -> None:
        estimate, los, near = now.get(PoseEstimate), now.get(LosObservation), now.get(ClearanceRecord)
        believed = None
        situation, assembly = now.get(ArenaEstimate), now.get(AssemblyProgress)
        if action.phase is Phase.ASSEMBLE and isinstance(situation, ArenaEstimate):
            believed = situation.own.X_WB
        elif step is not None and isinstance(estimate, PoseEstimate):
            believed = dock_frame(scene, step, units) @ estimate.X_DU
        frames.append(
            Snapshot(
                stamp_ns=action.stamp_ns,
                units=dict(units),
                obstacles=_standing(scene, starts, action.stamp_ns),
                step=step,
                estimate=believed,
                phase=action.phase,
                attempt=action.attempt,
                los=los if isinstance(los, LosObservation) else None,
                clearance=_clearance(near) if isinstance(near, ClearanceRecord) else None,
                twist=action.twist,
                reason=action.reason,
                situation=situation if isinstance(situation, ArenaEstimate) else None,
                assembly=assembly if isinstance(assembly, AssemblyProgress) else None,
                path=path,
            )
        )

    pending: Action | None = None
    for record in log.records("/truth/*", "/control/*", "/perception/*", topics.STEPS):
        message = record.message
        if isinstance(message, Action):
            # The truth of an instant is written after its decision: a decision is told with what follows it.
            if pending is not None:
                close(pending)
            pending = message
            now.clear()
        elif isinstance(message, AssemblyPath):
            path = message
        elif isinstance(message, TruePose):
            units[message.name] = message.X_WB
        elif isinstance(message, StartPoses):
            starts = message.poses
            units = {name: starts[name] for name in scene.units}
        elif isinstance(message, StepStart):
            if pending is not None:
                close(pending)
                pending = None
            path = None
            step = scene.plan[message.index]
        else:
            now[type(message)] = message
    if pending is not None:
        close(pending)
    return frames


def _standing(scene: Scene, starts: dict[str, SE2], stamp_ns: int) -> dict[str, SE2]:
    return {
        name: starts[name]
        for name, spec in scene.obstacles.items()
        if name in starts and spec.appears_at_s * 1e9 <= stamp_ns
    }


def _clearance(record: ClearanceRecord) -> Clearance | None:
    if record.nearest is None:
        return None
    a, b = ((float(p[0]), float(p[1])) for p in record.nearest)
    return Clearance(record.distance, record.pair[0], record.pair[1], a, b)


def verdict(log: Log) -> str | None:
    """Return the judge's last word as the log has it; None when the trial did not get that far."""
    words = [event.text for _, event in log.messages(Event, topics.EVENTS) if event.source == JUDGE]
    return words[-1] if words else None
