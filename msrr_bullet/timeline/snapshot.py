"""One instant of a trial, with truth and belief side by side: what viewer, figures and tables show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from msrr_bullet.collision.clearance import Clearance
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    CollisionMonitorState,
    LosObservation,
    Phase,
    Twist,
)
from msrr_scenes.specs.plan import DockStep


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """One instant of a trial.

    Attributes:
        stamp_ns: Simulated time.
        units: True poses ``X_WU`` of all units.
        obstacles: True poses ``X_WB`` of the obstacles that have appeared.
        step: Step of the plan in progress: which unit docks to which port.
        estimate: Pose ``X_WU`` that the docking unit believes to have; None without an estimate.
        phase: Phase of the docking unit; None before its first decision.
        attempt: Number of the docking attempt, from 1; 0 before the first.
        los: Line of sight of the docking unit to its target.
        clearance: Smallest clearance of all pairs of bodies that may not touch, which leaves out a pair that
            is docking and units that are locked together; None without such a pair.
        twist: Velocity command of the docking unit; None before its first decision.
        reason: Why the phase was entered.
        situation: Estimates of all bodies in the arena; None without an overhead camera in use.
        monitor: Decision of the collision monitor; None without an overhead camera.
        assembly: Progress of the long-distance phase; None outside that phase.
        path: Path that the long-distance phase follows or followed last.
    """

    stamp_ns: int
    units: Mapping[str, SE2]
    obstacles: Mapping[str, SE2] = field(default_factory=dict)
    step: DockStep | None = None
    estimate: SE2 | None = None
    phase: Phase | None = None
    attempt: int = 0
    los: LosObservation | None = None
    clearance: Clearance | None = None
    twist: Twist | None = None
    reason: str = ""
    situation: ArenaEstimate | None = None
    monitor: CollisionMonitorState | None = None
    assembly: AssemblyProgress | None = None
    path: AssemblyPath | None = None

    @property
    def docking_unit(self) -> str | None:
        """Name of the unit that docks."""
        return self.step.unit if self.step else None

    @property
    def docking_pose(self) -> SE2 | None:
        """True pose ``X_WU`` of the unit that docks."""
        return self.units.get(self.step.unit) if self.step else None

    @property
    def phase_text(self) -> str:
        """Phase, and stage of the long-distance phase, in words; empty before the first decision."""
        stage = f", {self.assembly.stage}" if self.assembly else ""
        return phase_name(self.phase) + stage if self.phase else ""

    @property
    def path_text(self) -> str:
        """Progress along the planned path in words; empty while no path is followed."""
        if self.assembly is None or self.path is None:
            return ""
        error = math.dist(self.assembly.tip, self.assembly.desired)
        return f"{self.assembly.s:.2f} of {self.assembly.length:.2f} m, {1e3 * error:.0f} mm off"


def phase_name(phase: Phase) -> str:
    """Return the name of a phase in words."""
    return phase.value.replace("_", " ")


def planned_paths(snapshots: Iterable[Snapshot]) -> list[AssemblyPath]:
    """Return every path that the long-distance phase chose, in order."""
    paths: list[AssemblyPath] = []
    for snapshot in snapshots:
        if snapshot.path is not None and (not paths or snapshot.path is not paths[-1]):
            paths.append(snapshot.path)
    return paths


class Viewer(Protocol):
    """Display of a running trial. It receives snapshots and has no influence on the trial."""

    def update(self, snapshot: Snapshot) -> None:
        """Show one instant of the trial. Instants come in order."""

    def close(self) -> None:
        """Release all resources. A second call does nothing."""
