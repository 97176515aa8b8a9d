"""One instant of a trial, with truth and belief side by side: what viewer, figures and tables show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

from msrr_bullet.collision.clearance import Clearance
from msrr_bullet.timeline.mission_snapshot import MissionSnapshot
from msrr_scenes.arrays import Array
from msrr_scenes.errors import MsrrError
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


class UnitStep(NamedTuple):
    """A step of a unit, by which the instants of one step are found."""

    unit: str
    step: DockStep | None
    number: int


@dataclass(frozen=True, slots=True, eq=False)
class StepSnapshot:
    """One instant of a unit under way, in a step or on a route into the open: what it does and believes.

    Attributes:
        unit: Name of the unit; empty for :data:`NOBODY`.
        step: The step: to which port the unit docks, or which one it leaves; None on a route into the open.
        estimate: Pose ``X_WU`` that the unit believes to have; None without an estimate.
        phase: Phase of the unit; None on a recording, which shows perception alone.
        attempt: Number of the docking attempt, from 1; 0 on a recording.
        los: Line of sight of the unit to its target.
        twist: Velocity command of the unit.
        reason: Why the phase was entered; in the long-distance phase why the unit does what it does.
        covariance: Covariance of the estimate (x, y, yaw) in the dock frame D, shape (3, 3) [m, rad]; None
            for one that is not relative to a port.
        situation: Estimates of all bodies in the arena; None without an overhead camera in use.
        monitor: Decision of the collision monitor; None without an overhead camera.
        assembly: Progress of the long-distance phase; None outside that phase.
        path: Path that the long-distance phase follows or followed last.
        number: Number of steps and routes that began before it: a unit may come back to a port.
    """

    unit: str
    step: DockStep | None
    estimate: SE2 | None
    phase: Phase | None
    attempt: int
    los: LosObservation | None = None
    twist: Twist | None = None
    reason: str = ""
    covariance: Array | None = None
    situation: ArenaEstimate | None = None
    monitor: CollisionMonitorState | None = None
    assembly: AssemblyProgress | None = None
    path: AssemblyPath | None = None
    number: int = 0

    @property
    def key(self) -> UnitStep:
        """The unit and its step."""
        return UnitStep(self.unit, self.step, self.number)

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


#: Stands for the first step under way while there is none.
NOBODY = StepSnapshot(unit="", step=None, estimate=None, phase=None, attempt=0)


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """One instant of a trial.

    Attributes:
        stamp_ns: Simulated time.
        units: True poses ``X_WU`` of all units; of a recording that of the target, whose port is the world.
        obstacles: True poses ``X_WB`` of the obstacles that have appeared.
        clearance: Smallest clearance of all pairs of bodies that may not touch, which leaves out a pair that
            is docking and units that are locked together; None without such a pair.
        steps: The units under way, in the order in which their steps began.
        mission: How the mission of a base station stands; None without one.
    """

    stamp_ns: int
    units: Mapping[str, SE2]
    obstacles: Mapping[str, SE2] = field(default_factory=dict)
    clearance: Clearance | None = None
    steps: tuple[StepSnapshot, ...] = ()
    mission: MissionSnapshot | None = None

    def apart(self) -> tuple[Snapshot, ...]:
        """Return this instant once for every step under way, each time with that step alone."""
        return tuple(replace(self, steps=(step,)) for step in self.steps)

    def of_unit(self, unit: str) -> Snapshot:
        """Return this instant with the step of one unit alone, or without a step if it has none under way."""
        return replace(self, steps=tuple(step for step in self.steps if step.unit == unit))

    @property
    def first(self) -> StepSnapshot:
        """The first step under way, which a display of a single step shows; :data:`NOBODY` without one."""
        return self.steps[0] if self.steps else NOBODY

    @property
    def watched(self) -> StepSnapshot | None:
        """The unit under way whose camera a display of a single one shows: the first one that docks.

        While none docks it is the first one under way.
        """
        docking = (step for step in self.steps if step.phase is not Phase.ASSEMBLE)
        return next(docking, self.first if self.steps else None)

    @property
    def docking_pose(self) -> SE2 | None:
        """True pose ``X_WU`` of the unit of the first step under way; None without one."""
        return self.units.get(self.first.unit)

    @property
    def shown(self) -> dict[str, SE2]:
        """Poses ``X_WU`` at which units are drawn: true ones, and beliefs where nobody knows the truth."""
        believed = {step.unit: step.estimate for step in self.steps if step.estimate is not None}
        return {**believed, **self.units}


def phase_name(phase: Phase | None) -> str:
    """Return the name of a phase in words; none has an empty one."""
    return "" if phase is None else phase.text


def step_histories(
    snapshots: Iterable[Snapshot],
) -> dict[UnitStep, list[tuple[Snapshot, StepSnapshot]]]:
    """Return the instants of every step, in order of time; the steps in the order in which they began."""
    histories: dict[UnitStep, list[tuple[Snapshot, StepSnapshot]]] = {}
    for snapshot in snapshots:
        for step in snapshot.steps:
            histories.setdefault(step.key, []).append((snapshot, step))
    return histories


def moving_units(snapshots: Iterable[Snapshot]) -> list[str]:
    """Return the units that have a step, in the order in which their first ones began."""
    return list(dict.fromkeys(step.unit for snapshot in snapshots for step in snapshot.steps))


def unit_of_curves(snapshots: Iterable[Snapshot], unit: str | None = None) -> str | None:
    """Return the unit to which curves over time have to be confined.

    None asks for the first one if several are under way at the same time, and for all (None) if not: then
    their curves follow one another.

    Raises:
        MsrrError: The unit has no step.
    """
    snapshots = list(snapshots)
    units = moving_units(snapshots)
    if unit is not None:
        if unit not in units:
            raise MsrrError(
                f"unit {unit!r} has no step in this run; units with one: {', '.join(units) or 'none'}"
            )
        return unit
    return units[0] if any(len(snapshot.steps) > 1 for snapshot in snapshots) else None


def of_unit(snapshots: Iterable[Snapshot], unit: str | None) -> tuple[Snapshot, ...]:
    """Return the instants of the steps of one unit, with these steps alone; all instants for None."""
    if unit is None:
        return tuple(snapshots)
    return tuple(of for of in (snapshot.of_unit(unit) for snapshot in snapshots) if of.steps)


def planned_paths(snapshots: Iterable[Snapshot]) -> list[AssemblyPath]:
    """Return every path that the long-distance phase of any step chose, in order."""
    paths: dict[int, AssemblyPath] = {}  # by identity: two units may choose equal paths
    for snapshot in snapshots:
        for step in snapshot.steps:
            if step.path is not None:
                paths.setdefault(id(step.path), step.path)
    return list(paths.values())


class Viewer(Protocol):
    """Display of a running trial. It receives snapshots and has no influence on the trial."""

    def update(self, snapshot: Snapshot) -> None:
        """Show one instant of the trial. Instants come in order."""

    def close(self) -> None:
        """Release all resources. A second call does nothing."""
