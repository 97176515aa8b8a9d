"""Tables of a mission that a base station led, and of its radio; the reference describes them."""

from __future__ import annotations

from collections.abc import Iterator

from msrr_bullet.export.table import TIME, UNIT, Row, Table, columns, one_of, time, unit
from msrr_bullet.log import LogRecord, topics
from msrr_bullet.log.records import RadioReceipt
from msrr_scenes.messages.coordination import (
    Authority,
    MissionState,
    MissionStatus,
    UnitMode,
    UnitReport,
    UnitState,
)


def _mission_rows(record: LogRecord, m: MissionStatus) -> Iterator[Row]:
    mission = m.state, len(m.done), len(m.given_up), m.replans, m.reason
    for u in m.units:
        extents = u.order, u.progress, u.limit, u.length
        own = u.unit, u.state, u.task, u.route, *extents, u.blocked_by, u.reason
        yield time(record.stamp_ns), *own, *mission


def _receipt_rows(record: LogRecord, m: RadioReceipt) -> Iterator[Row]:
    reported = record.topic == topics.report_received(m.unit)
    number = (None, time(m.number)) if reported else (m.number, None)
    yield *unit(record), "report" if reported else "authority", *number


MISSION_TABLES = (
    Table(
        "mission",
        "What the base station knew of a unit and of the mission; one row for each unit and decision.",
        MissionStatus,
        columns(
            **TIME,
            unit="name of the unit",
            state=f"what the unit is held for: {one_of(UnitState)}",
            task="task that it has or had last",
            route="number of its route, 0 before the first",
            order="place of its route: a later one keeps out of what an earlier one still has to drive",
            progress_m="arc length of the route that was reported or seen",
            limit_m="arc length up to which it may drive",
            length_m="arc length of the whole route",
            blocked_by="unit for which it waits",
            reason="why it is so",
            mission=f"how the mission stands: {one_of(MissionState)}",
            done="number of tasks that are done",
            given_up="number of tasks that were given up",
            replans="number of routes planned because an earlier one could not be driven to its end",
            mission_reason="why the mission stands so",
        ),
        _mission_rows,
    ),
    Table(
        "authorities",
        "Authority that the base station sent to a unit, without the legs of the route.",
        Authority,
        columns(
            **UNIT,
            number="number of the message, counted for each unit",
            route="number of the route, 0 for none",
            limit_m="arc length up to which the unit may drive, negative if it may not move",
            expires_s="time at which the authority ends, except in the dock leg",
            length_m="arc length of the whole route",
            target="port at which the route ends; empty if it ends in the open",
            unlock="1 when the unit is to open its lock before it moves",
        ),
        lambda record, m: [
            (
                *(*unit(record), m.seq, m.route, m.limit, time(m.expires_ns)),
                *(m.legs[-1].end if m.legs else 0.0, m.to, m.unlock),
            )
        ],
    ),
    Table(
        "reports",
        "Report that a unit sent to the base station.",
        UnitReport,
        columns(
            **UNIT,
            authority="number of the newest authority that the unit had received, 0 before the first",
            route="number of the route that it follows or has followed",
            progress_m="arc length of that route that it has covered",
            mode=f"what it does: {one_of(UnitMode)}",
            docked_to="port into which it believes that it is locked, or which it is leaving",
            reason="why it is in this mode",
        ),
        lambda record, m: [(*unit(record), m.seq, m.route, m.progress, m.mode, m.docked_to, m.reason)],
    ),
    Table(
        "receipts",
        "A message arrives over the radio: an authority at a unit, or a report at the base station.",
        RadioReceipt,
        columns(
            **UNIT,
            message="authority or report",
            number="number of the authority",
            sent_s="time of the report",
        ),
        _receipt_rows,
    ),
)
