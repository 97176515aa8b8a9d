"""The recall of a unit that cannot drive its route to the end because of something that is not on the map.

Its collision monitor may let it drive no further, an obstacle may have appeared in the lane of its port, or
the unit that it drives to may not stand where it was to stand.
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
        self._since_ns: dict[tuple[str, int], int] = {}  # from when on nothing is sent, by unit and route

    def is_recalled(self, unit: UnitRecord) -> bool:
        """Return whether a unit is to be sent no authority."""
        return (unit.name, unit.route) in self._since_ns

    def has_stopped(self, unit: UnitRecord, now_ns: int, in_vain: bool) -> bool:
        """Recall a unit that has been held for long, or that drives in vain.

        One that was held and makes progress after all may go on. One in its dock leg stops only when its
        attempt has failed, and it has backed off. A unit drives in vain if an obstacle stands in the lane of
        the port that it drives to, or the port is not to be where its route ends.

        Returns:
            Whether it stands and its authority has expired.
        """
        key = unit.name, unit.route
        since_ns = self._since_ns.get(key)
        if since_ns is None:
            held = self._is_held(unit, now_ns) and unit.recalls < self._patience.recalls
            if held or (in_vain and unit.under_way):
                self._since_ns[key] = now_ns
            return False
        if not unit.under_way or (unit.moved_ns > since_ns and not in_vain):
            del self._since_ns[key]
            return False
        expired_ns = since_ns + round(self._patience.expires_s * NS_PER_S)
        if unit.report is None or unit.report.stamp_ns <= expired_ns:
            return False
        if not unit.stands and not unit.has_not_set_out:
            return False
        del self._since_ns[key]
        if not in_vain:  # whatever holds units would hold them on each further route as well
            unit.recalls += 1
        return True

    def _is_held(self, unit: UnitRecord, now_ns: int) -> bool:
        """Return whether a unit that could drive on has been standing for too long."""
        track = unit.track
        if not unit.under_way or track is None or not unit.rests:
            return False
        free = unit.limit - unit.progress > SAME_M and unit.progress < track.dock_start - SAME_M
        heard = seconds(now_ns - unit.heard_ns) < self._patience.silent_s
        return free and heard and seconds(now_ns - unit.patient_ns) > self._patience.held_s
