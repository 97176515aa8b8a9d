"""One instant of a trial as the viewer and the picture show it: truth and belief side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from msrr_bullet.collision.clearance import Clearance
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import (
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
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
        units: Truth, ``X_WU`` of every unit.
        obstacles: Truth, ``X_WB`` of every obstacle that is there.
        step: The step of the plan in progress: who docks to which port.
        estimate: Where the docking unit believes to be, ``X_WU``; None while it believes nothing.
        phase: Its phase.
        attempt: Counted from 1; 0 before the first.
        los: Its line of sight to the target.
        clearance: The smallest clearance of any pair, docking pair included.
        twist: What the docking unit commands; None before its first decision.
        reason: Why its phase was entered.
        situation: What it knows of the whole arena; None when it does not look from above.
        assembly: What its long-distance phase does; None while that is not at work.
        path: The path which that phase follows, or followed last.
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
    assembly: AssemblyProgress | None = None
    path: AssemblyPath | None = None


#: Phases in which the docking pair may come close.
_DOCKING = (Phase.DOCK, Phase.LOCK, Phase.VERIFY, Phase.RETREAT, Phase.DONE, Phase.FAILED)


def meant_to_touch(snapshot: Snapshot) -> bool:
    """Say whether the nearest pair is the docking pair in a phase in which it may come close."""
    if snapshot.clearance is None or snapshot.step is None or snapshot.phase not in _DOCKING:
        return False
    return snapshot.clearance.pair == {snapshot.step.unit, snapshot.step.target_unit}


def planned_paths(frames: Iterable[Snapshot]) -> list[AssemblyPath]:
    """Return every path that the long-distance phase chose, in order."""
    found: list[AssemblyPath] = []
    for frame in frames:
        if frame.path is not None and (not found or frame.path is not found[-1]):
            found.append(frame.path)
    return found


class Viewer(Protocol):
    """Something that a running trial is shown to. It learns everything and answers nothing."""

    def update(self, snapshot: Snapshot) -> None:
        """Show the trial at one instant; instants come in order."""

    def close(self) -> None:
        """Release what the viewer holds; calling it twice is fine."""
