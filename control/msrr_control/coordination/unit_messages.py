"""What the base station sends about a unit, from what the ledger knows of it."""

from __future__ import annotations

import math
from collections.abc import Iterable

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.shapes.bodies import ACTIVE_PORT
from msrr_scenes.messages.coordination import Authority, Intent, UnitStatus

#: Distance within which units are told the intents of others [m].
_NEAR_M = 1.0


def next_authority(unit: UnitRecord, units: Iterable[UnitRecord], now_ns: int, expires_ns: int) -> Authority:
    """Return the next authority of a unit that has a track, sent at ``now_ns``, and note it in its record.

    It tells of the docks and intents of all units, and ends at ``expires_ns`` unless it is renewed.
    """
    assert unit.track is not None
    unit.seq += 1
    unit.expiries[unit.seq] = expires_ns
    return Authority(
        unit=unit.name,
        route=unit.route,
        seq=unit.seq,
        stamp_ns=now_ns,
        expires_ns=expires_ns,
        limit=unit.limit,
        legs=unit.track.legs,
        to=None if unit.enters is None else ".".join(unit.enters),
        unlock=unit.unlocks,
        joints=tuple(
            (f"{other.name}.{ACTIVE_PORT}", ".".join(port))
            for other in units
            if other.name != unit.name
            for port in other.docks
        ),
        intents=tuple(
            intent for other in units if _goes_first(other, unit) if (intent := _intent(other)) is not None
        ),
    )


def status_of(unit: UnitRecord) -> UnitStatus:
    """Return what everybody is told of a unit."""
    return UnitStatus(
        unit=unit.name,
        state=unit.state,
        task=unit.task,
        route=unit.route,
        order=unit.order,
        progress=unit.progress,
        limit=unit.limit,
        length=0.0 if unit.track is None else unit.track.length,
        blocked_by=unit.blocked_by,
        reason=unit.reason,
    )


def _goes_first(other: UnitRecord, unit: UnitRecord) -> bool:
    """Return whether another unit under way goes before one, and is so near that this one has to know."""
    if not other.under_way or other.order >= unit.order or other.X_WU is None or unit.X_WU is None:
        return False
    return math.hypot(other.X_WU.x - unit.X_WU.x, other.X_WU.y - unit.X_WU.y) < _NEAR_M


def _intent(unit: UnitRecord) -> Intent | None:
    """Return where a unit would still come if it stopped, as it has told; None at rest."""
    report = unit.report
    if report is None or not report.stopping:
        return None
    return Intent(unit.name, report.stamp_ns, report.stopping)
