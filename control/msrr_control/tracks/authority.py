"""The unit's side of coordination: how far it may drive, and where it brakes without radio."""

from __future__ import annotations

import math

from msrr_control.tracks.track import dock_start, path_of
from msrr_scenes.messages.coordination import Authority, LegKind, RouteLeg
from msrr_scenes.specs.vehicle import LimitsSpec

#: Share of the largest deceleration that is counted on.
_BRAKING_SHARE = 0.8


class MovementAuthority:
    """Keeps the newest authority and turns it into a limit.

    An authority that expires ends at the nearer of its limit and the place where the unit can stop from then
    on. It does not expire for a unit that has begun its dock leg, which was granted whole. A unit that waits
    before its dock leg, also after a failed attempt, begins it only by an authority that has not expired.

    Attributes:
        newest: The newest authority, None before the first.
    """

    def __init__(self, limits: LimitsSpec, reaction_s: float) -> None:
        """Begin without an authority.

        ``reaction_s`` is the longest time from a state to the effect on the wheels of what is decided on it,
        the period of control included.
        """
        self._deceleration = _BRAKING_SHARE * limits.a_max_mps2
        self._reaction = reaction_s
        self.newest: Authority | None = None
        self._stop: float | None = None  # where the unit stops because its authority has expired

    @property
    def legs(self) -> tuple[RouteLeg, ...]:
        """The legs of the route, none before the first authority."""
        return () if self.newest is None else self.newest.legs

    @property
    def length(self) -> float:
        """Arc length of the route [m]."""
        return self.legs[-1].end if self.legs else 0.0

    @property
    def dock_start(self) -> float:
        """Arc length at which the dock leg begins; that of the whole route if there is none [m]."""
        return dock_start(self.legs, self.length)

    @property
    def end_yaw(self) -> float:
        """Heading in which a route in the open ends, by its last leg [rad]; there has to be a route."""
        last = self.legs[-1]
        if last.kind in (LegKind.TURN, LegKind.REVERSE):
            return last.start[2] + last.turn
        return float(path_of(last).at(math.inf).heading)

    def receive(self, authority: Authority) -> bool:
        """Take in an authority unless a newer one is known; return whether it begins another route."""
        newest = self.newest
        if newest is not None and authority.seq <= newest.seq:
            return False
        self.newest, self._stop = authority, None
        return newest is None or newest.route != authority.route

    def limit(self, now_ns: int, progress: float, speed: float) -> float:
        """Return the arc length beyond which the unit may not drive [m].

        Args:
            now_ns: Present time.
            progress: Arc length that the unit has covered [m].
            speed: Speed along the route [m/s].
        """
        newest = self.newest
        if newest is None:
            return progress
        whole = self.length <= newest.limit
        if now_ns < newest.expires_ns or (whole and progress > self.dock_start + 1e-9):
            self._stop = None
            return newest.limit
        if self._stop is None:
            self._stop = min(newest.limit, progress + self.stopping_distance(speed))
        return self._stop

    def stopping_distance(self, speed: float) -> float:
        """Return the distance in which the unit stops from a speed [m], the reaction included."""
        return speed * self._reaction + 0.5 * speed * speed / self._deceleration
