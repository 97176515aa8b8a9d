"""The watch over units under way: who has arrived, who is lost, and whether anybody still moves."""

from __future__ import annotations

import math
from collections.abc import Iterable

from msrr_control.coordination.goal_tolerance import DEFAULT_TOLERANCE, GoalTolerance
from msrr_control.coordination.ledger import SAME_M, UnitRecord
from msrr_control.coordination.mission import Patience
from msrr_scenes.messages import NS_PER_S, seconds
from msrr_scenes.messages.coordination import UnitMode, UnitState

#: Distance beyond the dock leg, and beyond where a failed attempt leads, from which on a unit is in neither
#: [m]. It is more than the errors of where units are seen, begin that leg and stop.
_SHORT_M = 0.15

#: Time in which a unit stands still once its authority has expired [s].
_BRAKES_S = 1.0


class Watch:
    """Judges progress by reports and sights; time in which nobody can know anything does not count."""

    def __init__(self, patience: Patience, tolerance: GoalTolerance = DEFAULT_TOLERANCE) -> None:
        """Begin with nobody under way; ``tolerance`` is that of the ends of moves."""
        self._patience, self._tolerance = patience, tolerance
        self._quiet_ns = 0  # time from which on nobody has made progress
        self._previous_ns = 0

    def has_arrived(self, unit: UnitRecord, now_ns: int) -> bool:
        """Return whether a unit has driven its route to the end."""
        report, track = unit.report, unit.track
        if report is None or track is None or report.route != unit.route:
            return False
        if unit.enters is not None:
            return report.mode is UnitMode.DOCKED and unit.holder == unit.enters
        if unit.seen_ns < unit.moved_ns and seconds(now_ns - unit.moved_ns) < self._patience.unseen_s:
            return False  # a look will tell
        # Of a turn that is hardly longer than that, something has to be driven.
        off = min(SAME_M, 0.5 * track.length)
        if not unit.rests or unit.progress < track.length - off:
            return False
        # One that came to a stop too far on, or askew, may still be about to correct that.
        return self.is_at_end(unit) or seconds(now_ns - unit.moved_ns) >= self._patience.unseen_s

    def is_at_end(self, unit: UnitRecord) -> bool:
        """Return whether a unit that has driven its route stands where it ends."""
        assert unit.track is not None
        if unit.seen_ns < unit.moved_ns:
            return True  # nobody saw where it stands: its own word has to do
        return self._tolerance.holds(unit.track.end.inverse() @ unit.pose)

    def has_not_left(self, unit: UnitRecord) -> bool:
        """Return whether a unit that backs out of a port, and no farther, is seen nearer to where it was."""
        assert unit.track is not None
        if unit.seen_ns < unit.moved_ns:
            return False  # nobody saw where it stands: its own word has to do
        x, y, _ = unit.track.poses[0].tolist()
        return math.hypot(unit.pose.x - x, unit.pose.y - y) < 0.5 * unit.track.length

    def silence(self, unit: UnitRecord, now_ns: int) -> str | None:
        """Return for how long a unit under way was not heard, None if that is not too long.

        One that may be in its dock leg goes on without being heard: it has as long as one that is.
        """
        unheard = self._unheard_s(unit, now_ns)
        return f"not heard for {unheard:.0f} s" if unheard > self._most_unheard_s(unit) else None

    def is_to_stop(self, unit: UnitRecord, now_ns: int) -> bool:
        """Return whether a unit under way is sent no more authorities, as it will soon count as lost.

        The last one expires, and the unit brakes, before others are let onto the ground that it was granted.
        """
        left = self._most_unheard_s(unit) - self._unheard_s(unit, now_ns)
        return unit.under_way and left < self._patience.expires_s + _BRAKES_S

    def is_found(self, unit: UnitRecord) -> bool:
        """Return whether a unit that was lost stands, and was heard and seen since, or tells of its port.

        One that stood since it was not heard may drive on by an authority that was sent before it was lost,
        and has arrived late: it has to stand when that has expired. One that is in the port that it was to
        enter, or that says that it is lost, stays there. One on its way out of a port tells of it until it is
        clear.
        """
        report = unit.report
        if report is None or report.stamp_ns <= unit.still_ns:
            return False
        if unit.holder is not None and unit.holder == unit.enters:
            return True
        if unit.holder is not None and unit.unlocks and report.route == unit.route:
            return False
        expires_ns = 0 if unit.says_lost else round(self._patience.expires_s * NS_PER_S)
        stands = report.mode not in (UnitMode.DRIVING, UnitMode.DOCKING)
        seen = unit.seen_ns > unit.still_ns or unit.holder is not None
        return stands and seen and report.stamp_ns > unit.still_ns + expires_ns

    def stopped_short(self, unit: UnitRecord) -> bool:
        """Return whether a unit that was lost unheard is known to have stopped before its dock leg.

        It is if it was seen far from its port after its last authority had expired: it begins the dock leg
        only by one that has not. One that has begun that leg goes on by itself, also after it has backed off.
        """
        track = unit.track
        if track is None or unit.enters is None or unit.holder is not None or unit.says_lost:
            return False
        if unit.seen_ns <= unit.still_ns + round(self._patience.expires_s * NS_PER_S):
            return False
        reach = max(track.length - track.dock_start, unit.retreat_m) + _SHORT_M
        away = math.hypot(unit.pose.x - track.end.x, unit.pose.y - track.end.y)
        return unit.progress < track.dock_start - SAME_M and away > reach

    def stagnation(self, unit: UnitRecord, now_ns: int) -> str | None:
        """Return for how long a unit under way made no progress, None if that is not too long."""
        # At the end of what it may drive a unit waits for others, but for nobody in its dock leg: there it is
        # to lock, or to move because it tries again. Nor does it where its route ends in the open: it stands
        # there without having arrived because its authority has expired, and it hears nothing.
        at_limit = unit.limit <= unit.progress + SAME_M
        ends = unit.enters is None and unit.track is not None and unit.limit >= unit.track.length - 1e-9
        moves = unit.report is not None and bool(unit.report.stopping)
        waits = at_limit and not ends and (moves or unit.report is None or not unit.in_dock_leg)
        if self._docks(unit) and moves and seconds(now_ns - unit.moved_ns) < self._patience.tries_s:
            unit.patient_ns = now_ns  # it backs off or comes again: it ends that by itself, and tells of it
        elif waits or self._unheard_s(unit, now_ns) > self._patience.silent_s:
            unit.patient_ns += now_ns - self._previous_ns
        wait = self._patience.dock_s if self._docks(unit) else self._patience.lost_s
        if seconds(now_ns - unit.patient_ns) > wait:
            said = (
                "" if unit.report is None or not unit.report.reason else f"; it says {unit.report.reason!r}"
            )
            return f"no progress beyond {unit.progress:.2f} m in {wait:.0f} s{said}"
        return None

    def _most_unheard_s(self, unit: UnitRecord) -> float:
        return self._patience.dock_s if self._docks(unit) else self._patience.unheard_s

    def _unheard_s(self, unit: UnitRecord, now_ns: int) -> float:
        return seconds(now_ns - max(unit.heard_ns, unit.granted_ns))

    def _docks(self, unit: UnitRecord) -> bool:
        """Return whether a unit is in its dock leg: one that may drive into it can still be far away."""
        return unit.in_dock_leg and unit.track is not None and unit.progress >= unit.track.dock_start - SAME_M

    def may_be_found(self, unit: UnitRecord, now_ns: int) -> bool:
        """Return whether a unit is lost or was never seen, and not for so long that nothing waits for it."""
        out_of_sight = unit.state is UnitState.LOST or (unit.X_WU is None and not unit.out_of_action)
        return out_of_sight and seconds(now_ns - unit.still_ns) < self._patience.lost_s

    def waits(self, unit: UnitRecord) -> bool:
        """Return whether a unit rests where its authority ends, or has not been allowed to begin."""
        stands = unit.stands_at_limit or unit.limit < 0.0
        return unit.under_way and not unit.in_dock_leg and stands

    def restart(self, now_ns: int) -> None:
        """Begin to wait anew, because something has happened."""
        self._quiet_ns = now_ns

    def nobody_moves(self, units: Iterable[UnitRecord], now_ns: int) -> bool:
        """Return whether nobody has made progress for too long, other than for want of radio.

        A unit in its dock leg, which was granted as a whole, waits for nobody: after an attempt that failed
        it backs off, looks for the port and comes again, which is no progress beyond where it has been. It
        docks, fails or is lost.
        """
        under_way = [unit for unit in units if unit.under_way]
        silent = any(seconds(now_ns - unit.heard_ns) > self._patience.silent_s for unit in under_way)
        free = any(unit.in_dock_leg or unit.limit > unit.progress + SAME_M for unit in under_way)
        if silent or free or not under_way:
            self._quiet_ns = now_ns
        moved = max((unit.moved_ns for unit in under_way), default=now_ns)
        return seconds(now_ns - max(self._quiet_ns, moved)) > self._patience.stalled_s

    def advance(self, now_ns: int) -> None:
        """Note the end of a step."""
        self._previous_ns = now_ns
