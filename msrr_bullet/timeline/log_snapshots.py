"""Snapshots of a trial at every decision, and the verdict on it, read from the log."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msrr_bullet.log import topics
from msrr_bullet.log.records import Event
from msrr_bullet.timeline.snapshot import Snapshot
from msrr_bullet.timeline.snapshot_builder import SnapshotBuilder

if TYPE_CHECKING:  # a running trial makes snapshots without reading a log
    from msrr_bullet.log.reader import Log

#: Topics of the messages of which snapshots are made.
_TOPICS = ("/truth/*", "/control/*", "/perception/*", "/coordination/*", "/radio/*", topics.STEPS)


def read_snapshots(log: Log) -> list[Snapshot]:
    """Return a snapshot of the trial at every decision of a robot, in order.

    In a mission that a base station leads there is one at every control instant.
    """
    builder, snapshots = SnapshotBuilder(log.header.scene), []
    for record in log.records(*_TOPICS):
        if builder.is_over(record.stamp_ns, record.message):
            snapshots.append(builder.finish())
        builder.add(record.topic, record.stamp_ns, record.message)
    snapshots.append(builder.finish())
    return [snapshot for snapshot in snapshots if snapshot is not None]


def read_events(log: Log) -> list[Event]:
    """Return all events of the run, in order."""
    return [event for _, event in log.messages(Event, topics.EVENTS)]


def read_verdict(log: Log) -> str | None:
    """Return the judge's verdict on the trial; None when the trial did not get that far."""
    return next((event.text for event in reversed(read_events(log)) if event.is_verdict), None)
