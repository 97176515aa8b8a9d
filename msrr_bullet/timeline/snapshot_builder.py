"""Snapshots put together from the messages of a trial, while it runs or from its log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from msrr_bullet.log import topics
from msrr_bullet.log.records import ClearanceRecord, RadioReceipt, StartPoses, StepStart, TruePose
from msrr_bullet.timeline.mission_snapshot import MissionSnapshot
from msrr_bullet.timeline.snapshot import Snapshot, StepSnapshot, UnitStep
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
from msrr_scenes.messages.coordination import Authority, MissionStatus, UnitReport
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene

T = TypeVar("T")

#: What is logged for each unit and decision, and is shown until the next one.
_OF_DECISIONS = (PoseEstimate, ArenaEstimate, LosObservation, CollisionMonitorState, AssemblyProgress)


def target_frame(scene: Scene, step: DockStep, units: Mapping[str, SE2]) -> SE2:
    """Return the dock frame ``X_WD`` of a step's target, for units at the poses ``X_WU`` given."""
    return units[step.target_unit] @ scene.dock_frame(step)


class SnapshotBuilder:
    """Groups messages into snapshots, one for every instant at which robots decided.

    The estimates and the truth of an instant follow the decisions, so an instant is over when a message of a
    later one comes. In a mission of a base station an instant is one of the truth, with or without decisions.
    On a recording an instant is one of the line of sight.
    """

    def __init__(self, scene: Scene) -> None:
        """Begin before the first message of a trial of a scene."""
        self._scene = scene
        self._X_BD: dict[str, SE2] = {}  # dock frames of the targets, by unit and port
        self._steps: dict[str, UnitStep] = {}  # by unit, in the order in which they began
        self._begun = 0
        self._starts: dict[str, SE2] = {}
        self._units: dict[str, SE2] = {}
        self._paths: dict[str, AssemblyPath] = {}
        self._status: MissionStatus | None = None
        self._reports: dict[str, UnitReport] = {}
        self._authorities: dict[str, Authority] = {}
        self._heard_ns: dict[str, int] = {}
        self._stamp_ns = 0
        self._truth = False
        self._actions: dict[str, Action | None] = {}  # None: perception alone, as on a recording
        self._latest: dict[tuple[str, type], object] = {}
        self._clearance: ClearanceRecord | None = None

    def is_over(self, stamp_ns: int, message: object) -> bool:
        """Return whether a message is of a later instant than those before it."""
        begins = isinstance(message, StepStart) and not self._scene.coordinated
        return (stamp_ns > self._stamp_ns or begins) and (self._truth or bool(self._actions))

    def add(self, topic: str, stamp_ns: int, message: object) -> None:
        """Take in a message; others than those of which snapshots are made have no effect."""
        match message:
            case Action():
                self._actions[topics.unit_of(topic)], self._stamp_ns = message, stamp_ns
            case TruePose():
                self._units[message.name], self._stamp_ns, self._truth = message.X_WB, stamp_ns, True
            case AssemblyPath():
                self._paths[topics.unit_of(topic)] = message
            case StartPoses():
                self._starts = message.poses
                self._units = {n: message.poses[n] for n in self._scene.units if n in message.poses}
            case StepStart():
                self._begin(message)
            case ClearanceRecord():
                self._clearance = message
            case MissionStatus():
                self._status = message
            case UnitReport():
                self._reports[message.unit] = message
            case Authority():
                self._authorities[message.unit] = message
            case RadioReceipt():
                if topic == topics.report_received(message.unit):
                    self._heard_ns[message.unit] = stamp_ns
            case _:
                if isinstance(message, _OF_DECISIONS):
                    self._latest[topics.unit_of(topic), type(message)] = message
                if isinstance(message, LosObservation):
                    self._actions.setdefault(topics.unit_of(topic), None)
                    self._stamp_ns = stamp_ns

    def _begin(self, start: StepStart) -> None:
        path = self._paths.get(start.unit)
        if path is not None and path.stamp_ns < start.stamp_ns:  # else the new step has chosen it already
            del self._paths[start.unit]
        self._steps.pop(start.unit, None)
        self._steps[start.unit] = UnitStep(start.unit, start.step(self._scene), self._begun)
        self._begun += 1

    def finish(self) -> Snapshot | None:
        """Return the instant that is over; None if nobody decided in it and it is none of a mission."""
        truth, self._truth = self._truth, False
        actions, self._actions = self._actions, {}
        latest, self._latest = self._latest, {}
        clearance, self._clearance = self._clearance, None
        if not (truth if self._scene.coordinated else actions):
            return None
        stamp_ns = self._stamp_ns
        mission = None
        if self._status is not None:
            known = dict(self._reports), dict(self._authorities), dict(self._heard_ns)
            mission = MissionSnapshot(self._status, *known)
        return Snapshot(
            stamp_ns=stamp_ns,
            units=dict(self._units),
            obstacles=self._obstacles(stamp_ns),
            clearance=clearance.clearance if clearance else None,
            steps=tuple(
                self._step(step, actions[step.unit], latest)
                for step in self._steps.values()
                if step.unit in actions
            ),
            mission=mission,
        )

    def _step(
        self, unit_step: UnitStep, action: Action | None, latest: Mapping[tuple[str, type], object]
    ) -> StepSnapshot:
        unit, step, number = unit_step

        def get(kind: type[T]) -> T | None:
            message = latest.get((unit, kind))
            return message if isinstance(message, kind) else None

        estimate, situation = get(PoseEstimate), get(ArenaEstimate)
        believed, covariance = None, None
        if action is not None and action.phase is Phase.ASSEMBLE and situation is not None:
            believed = situation.own.X_WB
        elif estimate is not None and step is not None:
            if step.to not in self._X_BD:  # asking the scene for it looks at files
                self._X_BD[step.to] = self._scene.dock_frame(step)
            believed = self._units[step.target_unit] @ self._X_BD[step.to] @ estimate.X_DU
            covariance = estimate.covariance
        return StepSnapshot(
            unit=unit,
            step=step,
            estimate=believed,
            phase=action.phase if action else None,
            attempt=action.attempt if action else 0,
            los=get(LosObservation),
            twist=action.twist if action else None,
            reason=action.reason if action else "",
            covariance=covariance,
            situation=situation,
            monitor=get(CollisionMonitorState),
            assembly=get(AssemblyProgress),
            path=self._paths.get(unit),
            number=number,
        )

    def _obstacles(self, stamp_ns: int) -> dict[str, SE2]:
        return {
            name: self._starts[name]
            for name, spec in self._scene.obstacles.items()
            if name in self._starts and spec.appears_at_s * 1e9 <= stamp_ns
        }
