"""A mission at one instant in words: a line for the mission, and a row for every unit."""

from __future__ import annotations

from dataclasses import dataclass

from msrr_bullet.timeline.mission_snapshot import Activity, MissionSnapshot
from msrr_bullet.timeline.snapshot import Snapshot, phase_name
from msrr_scenes.messages import seconds


@dataclass(frozen=True, slots=True)
class UnitRow:
    """What a table shows of one unit.

    Attributes:
        unit: Name of the unit.
        does: What it does, and whether the base station does not hear it.
        task: Where its route leads; empty before the first.
        route: Arc lengths that it has covered, may drive, and has to drive [m]; empty before the first route.
        waits_for: Unit for which it waits or will wait at the end of what is granted; empty without one.
        reason: Why it does this, in words; may be empty.
    """

    unit: str
    does: str
    task: str
    route: str
    waits_for: str
    reason: str


def mission_text(mission: MissionSnapshot) -> str:
    """Return how a mission stands, in words."""
    status = mission.status
    waiting = sum(mission.activity(unit.unit) is Activity.WAITING for unit in status.units)
    counts = {
        "tasks done": len(status.done),
        "given up": len(status.given_up),
        "waiting": waiting,
        "routes planned anew": status.replans,
    }
    parts = [status.state.value, *(f"{what}: {count}" for what, count in counts.items() if count)]
    return ", ".join(parts) + (f"; {status.reason}" if status.reason else "")


def unit_rows(snapshot: Snapshot) -> list[UnitRow]:
    """Return the rows of all units of a mission, in the order of the scene; none without a mission."""
    if snapshot.mission is None:
        return []
    return [_row(snapshot, snapshot.mission, unit) for unit in snapshot.units]


def _row(snapshot: Snapshot, mission: MissionSnapshot, unit: str) -> UnitRow:
    status, authority, report = mission.of(unit), mission.authorities.get(unit), mission.reports.get(unit)
    activity, step = mission.activity(unit), next((s for s in snapshot.steps if s.unit == unit), None)
    does = activity.value
    if step is not None and activity is Activity.DOCKING:
        does = f"docking: {phase_name(step.phase)}"
    if mission.is_silent(unit, snapshot.stamp_ns):
        does += f", not heard for {seconds(snapshot.stamp_ns - mission.heard_ns.get(unit, 0)):.0f} s"
    task = "" if authority is None else authority.to or "into the open"
    lengths = status.progress, max(status.limit, 0.0), status.length
    reason = status.reason
    if not reason and report is not None and activity in (Activity.DOCKING, Activity.FAILED):
        reason = report.reason
    return UnitRow(
        unit=unit,
        does=does,
        task=task,
        route=" / ".join(f"{length:.2f}" for length in lengths) + " m" if status.route else "",
        waits_for=status.blocked_by or "",
        reason=reason,
    )
