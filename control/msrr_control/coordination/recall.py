"""The recall of a unit that cannot drive its route to the end because of something that is not on the map.

Its collision monitor may let it drive no further, or an obstacle may have appeared in the lane of its port.
"""

from __future__ import annotations

from msrr_control.coordination.ledger import SAME_M, UnitRecord
from msrr_control.coordination.mission import Patience
from msrr_scenes.messages import NS_PER_S, seconds


class Recall:
    """Gets units to stand without an authority, so that they can be given another route from there.

    An authority cannot be taken back: the unit might not hear of it. It is not renewed instead, and after it
    has expired the unit stays where it stands, whatever it hears of that route.
    """

    def __init__(self, patience: Patience) -> None:
        """Begin with nobody recalled."""
        self._patience = patience
        self._since_ns: dict[str, int] = {}  # time from which on a unit is sent no authority
        self._times: dict[str, int] = {}

    def is_recalled(self, unit: UnitRecord) -> bool:
        """Return whether a unit is to be sent no authority."""
        return unit.name in self._since_ns

    def has_stopped(self, unit: UnitRecord, now_ns: int, lane_closed: bool) -> bool:
        """Recall a unit that has been held for long, or whose lane is closed.

        One that was held and makes progress after all may go on. One in its dock leg stops only when its
        attempt has failed, and it has backed off.

        Args:
            unit: The unit.
            now_ns: Time [ns].
            lane_closed: Whether an obstacle stands in the lane of the port that the unit drives to.

        Returns:
            Whether it stands and its authority has expired.
        """
        since_ns = self._since_ns.get(unit.name)
        if since_ns is None:
            held = self._is_held(unit, now_ns) and self._times.get(unit.name, 0) < self._patience.recalls
            if held or (lane_closed and unit.under_way):
                self._since_ns[unit.name] = now_ns
            return False
        if not unit.under_way or (unit.moved_ns > since_ns and not lane_closed):
            del self._since_ns[unit.name]
            return False
        expired_ns = since_ns + round(self._patience.expires_s * NS_PER_S)
        if unit.report is None or unit.report.stamp_ns <= expired_ns or not unit.stands:
            return False
        del self._since_ns[unit.name]
        self._times[unit.name] = self._times.get(unit.name, 0) + 1
        return True

    def _is_held(self, unit: UnitRecord, now_ns: int) -> bool:
        """Return whether a unit that could drive on has been standing for too long."""
        track = unit.track
        if not unit.under_way or track is None or not unit.rests:
            return False
        free = unit.limit - unit.progress > SAME_M and unit.progress < track.dock_start - SAME_M
        heard = seconds(now_ns - unit.heard_ns) < self._patience.silent_s
        return free and heard and seconds(now_ns - unit.patient_ns) > self._patience.held_s
