"""What the units of a mission did over time, and what happened to them, computed from snapshots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

from msrr_bullet.timeline.mission_snapshot import Activity
from msrr_bullet.timeline.series import spans
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_scenes.messages import Phase, seconds
from msrr_scenes.messages.coordination import UnitState

#: Phases of a docking attempt, and phases that follow a failed one.
ATTEMPT = (Phase.DOCK, Phase.LOCK, Phase.VERIFY, Phase.TUG_TEST)
AFTER_FAILURE = (Phase.RETREAT, Phase.ASSEMBLE, Phase.HAND_OVER, Phase.FAILED)


@dataclass(frozen=True, slots=True)
class Span:
    """A time in which a unit did the same; it waited for another unit, or for none."""

    activity: Activity
    waits_for: str | None
    start_s: float
    end_s: float


class EventKind(Enum):
    """What happened to a unit of a mission."""

    GRANTED = "route granted"
    DOCKED = "docked"
    UNDOCKED = "undocked"
    ATTEMPT_FAILED = "failed attempt"
    LOST = "lost"
    FOUND = "found again"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class MissionEvent:
    """Something that happened to a unit; its text, which may be empty, says where to or why."""

    kind: EventKind
    time_s: float
    text: str = ""


def activity_spans(snapshots: Sequence[Snapshot], unit: str) -> Iterator[Span]:
    """Yield what a unit did, in order of time, without gaps."""
    shown = [(seconds(s.stamp_ns), s.mission) for s in snapshots if s.mission]
    does = [(mission.activity(unit), mission.waits_for(unit)) for _, mission in shown]
    for (activity, waits_for), start_s, end_s in spans([time_s for time_s, _ in shown], does):
        yield Span(activity, waits_for, start_s, end_s)


def silent_spans(snapshots: Sequence[Snapshot], unit: str) -> Iterator[tuple[float, float]]:
    """Yield beginning and end of the times in which the base station did not hear a unit [s]."""
    shown = [(s.stamp_ns, s.mission) for s in snapshots if s.mission]
    silent = [mission.is_silent(unit, stamp_ns) for stamp_ns, mission in shown]
    for is_silent, start_s, end_s in spans([seconds(stamp_ns) for stamp_ns, _ in shown], silent):
        if is_silent:
            yield start_s, end_s


def unit_events(snapshots: Sequence[Snapshot], unit: str) -> Iterator[MissionEvent]:
    """Yield what happened to a unit, in order of time."""
    for before, after in pairwise(s for s in snapshots if s.mission):
        time_s = seconds(after.stamp_ns)
        for kind, text in _changes(before, after, unit):
            yield MissionEvent(kind, time_s, text)


def _changes(before: Snapshot, after: Snapshot, unit: str) -> Iterator[tuple[EventKind, str]]:
    old, new = before.mission, after.mission
    assert old is not None
    assert new is not None
    granted, was = new.granted(unit), old.granted(unit)
    if granted is not None and (was is None or was.route != granted.route):
        yield EventKind.GRANTED, f"to {granted.to}" if granted.to else new.of(unit).reason or "into the open"
    left, entered = old.docked_to(unit), new.docked_to(unit)
    if left is not None and left != entered:
        yield EventKind.UNDOCKED, left
    if entered is not None and left != entered:
        yield EventKind.DOCKED, entered
    steps = {step.key: step for step in before.steps if step.unit == unit}
    for step in after.steps:
        earlier = steps.get(step.key)
        if earlier is not None and earlier.phase in ATTEMPT and step.phase in AFTER_FAILURE:
            yield EventKind.ATTEMPT_FAILED, step.reason
    was_lost, is_lost = (status.state is UnitState.LOST for status in (old.of(unit), new.of(unit)))
    if was_lost != is_lost:
        yield EventKind.LOST if is_lost else EventKind.FOUND, new.of(unit).reason
    if new.activity(unit) is Activity.FAILED and old.activity(unit) is not Activity.FAILED:
        report = new.reports.get(unit)
        yield EventKind.FAILED, new.of(unit).reason or (report.reason if report else "")
