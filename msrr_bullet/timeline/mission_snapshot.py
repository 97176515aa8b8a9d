"""One instant of a mission of a base station: what it knows, what units report, who waits for whom."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from msrr_control.coordination.mission import Patience
from msrr_scenes.messages import NS_PER_S
from msrr_scenes.messages.coordination import (
    Authority,
    MissionStatus,
    UnitMode,
    UnitReport,
    UnitState,
    UnitStatus,
)

#: Time without a report after which a unit is shown as not heard [ns]: that from which on the base station
#: itself counts it as silent.
SILENT_NS = round(Patience().silent_s * NS_PER_S)


class Activity(Enum):
    """What a unit of a mission does, as displays show it."""

    STANDING = "standing"
    WAITING = "waiting"  # stands on its route because another unit has to go first
    DRIVING = "driving"
    DOCKING = "docking"
    IN_PLACE = "in place"  # docked, or the first unit of a shape
    LOST = "lost"  # not localised or not heard, until it is
    FAILED = "failed"


@dataclass(frozen=True, slots=True, eq=False)
class MissionSnapshot:
    """One instant of a mission.

    Attributes:
        status: How the mission stands, as the base station knows it.
        reports: Newest report that each unit has sent, whether or not it arrives.
        authorities: Newest authority that was sent to each unit that has got one, whether or not it arrives.
        heard_ns: Time at which a report of each unit last arrived at the base station.
    """

    status: MissionStatus
    reports: Mapping[str, UnitReport]
    authorities: Mapping[str, Authority]
    heard_ns: Mapping[str, int]

    def of(self, unit: str) -> UnitStatus:
        """Return what the base station knows about a unit."""
        return next(status for status in self.status.units if status.unit == unit)

    def activity(self, unit: str) -> Activity:
        """Return what a unit does, by its own report where there is one."""
        status, report = self.of(unit), self.reports.get(unit)
        mode = UnitMode.STANDING if report is None else report.mode
        if status.state is UnitState.FAILED or mode is UnitMode.FAILED:
            return Activity.FAILED
        if status.state is UnitState.LOST or mode is UnitMode.LOST:
            return Activity.LOST
        if mode is UnitMode.DOCKED:
            return Activity.IN_PLACE
        if mode is not UnitMode.STANDING:
            return Activity.DOCKING if mode is UnitMode.DOCKING else Activity.DRIVING
        if status.state is UnitState.DOCKED:
            return Activity.IN_PLACE
        return Activity.STANDING if status.blocked_by is None else Activity.WAITING

    def waits_for(self, unit: str) -> str | None:
        """Return the unit for which a unit stands still; None if it waits for nobody."""
        return self.of(unit).blocked_by if self.activity(unit) is Activity.WAITING else None

    def docked_to(self, unit: str) -> str | None:
        """Return the port ``<unit>.<port>`` in which a unit says that it is locked; None if it is free."""
        report = self.reports.get(unit)
        return None if report is None else report.docked_to

    def is_silent(self, unit: str, now_ns: int) -> bool:
        """Return whether the base station has not heard a unit for too long."""
        return now_ns - self.heard_ns.get(unit, 0) > SILENT_NS

    def granted(self, unit: str) -> Authority | None:
        """Return the authority on which a unit is under way; None without one."""
        authority, status = self.authorities.get(unit), self.of(unit)
        if authority is None or authority.route != status.route:
            return None
        return authority if status.state is UnitState.UNDER_WAY else None
