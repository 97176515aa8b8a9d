"""The ledger of the coordinator: what it knows about every unit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from msrr_control.tracks.track import Track, standing
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import GlobalPose, seconds
from msrr_scenes.messages.coordination import UnitMode, UnitReport, UnitState

#: Distance that a seen pose is set back along a track before it frees ground [m], and from the track [m].
_SEEN_BACK_M, _SEEN_OFF_M = 0.06, 0.06

#: Distance by which a unit may be seen farther along its track than it can have driven [m].
_SEEN_AHEAD_M = 0.1

#: Arc length by which two progresses have to differ to count as different [m].
SAME_M = 0.015


@dataclass
class UnitRecord:
    """What the coordinator knows about one unit.

    Attributes:
        name: Name of the unit.
        X_WU: Pose that was seen last, in a port the one that all sights of the assembly and its docks give
            together; None before the first.
        sight: What was seen of it last; None if it has moved since, or was never seen.
        seen_ns: Time of the exposure in which it was seen last.
        report: Newest report; None before the first.
        heard_ns: Time at which the unit was last heard.
        state: What the unit counts as.
        task: Task that it has or had last; None before the first.
        route: Number of its route.
        order: Place of its route among all routes.
        track: Its route; None before the first, and after a recall.
        granted_ns: Time at which the route was granted.
        limit: Arc length up to which it may drive [m].
        progress: Arc length that was reported or seen [m].
        moved_ns: Time of its last progress.
        patient_ns: The same, moved on by all time for which the unit had to wait or was not heard.
        still_ns: Time from which on it stands still for others, with a pose that they were not told of.
        holder: Unit and port that it is locked to; None if it is free.
        enters: Unit and port at which its route ends; None in the open, and once it can no longer get there.
        seat: Pose in that port by the newest estimate of where it is; None if that is elsewhere.
        unlocks: Whether its route begins in a port.
        blocked_by: Unit for which it waits.
        seq: Number of the last authority.
        expiries: Time at which each authority ends that the unit may have as its newest, by number.
        expired: Whether the newest authority that the unit had got had ended when it sent its report.
        retreat_m: Distance before the end of a dock leg to which a failed attempt leads back [m].
        fastest_mps: Speed that it does not exceed [m/s].
        held: Whether its collision monitor has held it where it stands.
        evasions: How often it was sent out of the way since the mission has advanced.
        recalls: How often it was given another route since then because its collision monitor held it.
        reason: Why it is in that state, in words.
    """

    name: str
    X_WU: SE2 | None = None
    sight: GlobalPose | None = None
    seen_ns: int = 0
    report: UnitReport | None = None
    heard_ns: int = 0
    state: UnitState = UnitState.IDLE
    task: str | None = None
    route: int = 0
    order: int = 0
    track: Track | None = None
    granted_ns: int = 0
    limit: float = -1.0
    progress: float = 0.0
    moved_ns: int = 0
    patient_ns: int = 0
    still_ns: int = 0
    holder: tuple[str, str] | None = None
    enters: tuple[str, str] | None = None
    seat: SE2 | None = None
    unlocks: bool = False
    blocked_by: str | None = None
    seq: int = 0
    expiries: dict[int, int] = field(default_factory=dict)
    expired: bool = False
    retreat_m: float = 0.5
    fastest_mps: float = math.inf
    held: bool = False
    evasions: int = 0
    recalls: int = 0
    reason: str = ""

    @property
    def pose(self) -> SE2:
        """Where the unit stands, as far as the coordinator knows; only for units that have been seen."""
        assert self.X_WU is not None
        return self.X_WU

    @property
    def under_way(self) -> bool:
        """Whether the unit has a route that it has not driven to its end."""
        return self.state is UnitState.UNDER_WAY

    @property
    def out_of_action(self) -> bool:
        """Whether the unit has failed or is lost: it is sent nothing, and nobody docks to it."""
        return self.state in (UnitState.FAILED, UnitState.LOST)

    @property
    def in_dock_leg(self) -> bool:
        """Whether the unit is or may be in its dock leg."""
        return self.under_way and self._may_enter

    @property
    def _may_enter(self) -> bool:
        """Whether the unit was allowed into the port at which its route ends."""
        return self.track is not None and self.limit > self.track.dock_start + 1e-9

    @property
    def may_go_on(self) -> bool:
        """Whether the unit is lost unheard, and may be in its dock leg, which it drives to the end by itself.

        It is so until it is heard or seen to have stopped. Meanwhile its way and its port are kept for it.
        """
        lost = self.state is UnitState.LOST and not self.says_lost
        return lost and self.enters is not None and self._may_enter

    @property
    def passed(self) -> float:
        """Arc length behind which the ground is free for others [m].

        The last part of a dock leg is free only when it is over: a failed attempt leads back along it.
        """
        track = self.track
        if track is None or self.enters is None:
            return self.progress
        return min(self.progress, max(track.length - self.retreat_m, track.dock_start))

    @property
    def has_not_set_out(self) -> bool:
        """Whether the unit reports that it stands, or is docked, after a route before its own.

        It has not heard of its own yet, or what it heard had expired.
        """
        report = self.report
        if report is None or report.route >= self.route:
            return False
        return report.mode in (UnitMode.STANDING, UnitMode.DOCKED)

    @property
    def stands(self) -> bool:
        """Whether the unit reports of its route that it stands."""
        report = self.report
        return report is not None and report.route == self.route and report.mode is UnitMode.STANDING

    @property
    def rests(self) -> bool:
        """Whether the unit stands and will not go on by what it has been sent.

        One whose authority has ended stands short of its limit, and drives on when the next one arrives.
        """
        return self.stands and not self.expired

    @property
    def says_lost(self) -> bool:
        """Whether the unit reports of its route that it stands because it is not localised."""
        report = self.report
        return report is not None and report.route == self.route and report.mode is UnitMode.LOST

    @property
    def stands_at_limit(self) -> bool:
        """Whether the unit has come to rest where its authority ends."""
        return self.stands and self.progress >= self.limit - SAME_M

    def receive(self, report: UnitReport, now_ns: int) -> None:
        """Take in a report, unless a newer one is known."""
        if self.report is not None and report.stamp_ns <= self.report.stamp_ns:
            return
        self.report, self.heard_ns = report, now_ns
        self.expired = report.stamp_ns >= self.expiries.get(report.seq, 0)
        self.expiries = {seq: ends_ns for seq, ends_ns in self.expiries.items() if seq >= report.seq}
        if report.docked_to is None:
            self.holder = None
        else:
            unit, _, port = report.docked_to.partition(".")
            self.holder = (unit, port)
        if report.route == self.route:
            self._advance(report.progress, now_ns)

    def observe(self, body: GlobalPose, now_ns: int) -> None:
        """Take in where the unit was seen."""
        if self.X_WU is None:
            self.still_ns = now_ns  # routes that were planned before may lead through it
        self.X_WU, self.sight, self.seen_ns = body.X_WB, body, body.stamp_ns
        if self.track is None or not self.under_way:
            return
        from_m, since_ns = 0.0, self.granted_ns
        if self.report is not None and self.report.route == self.route:
            from_m, since_ns = self.report.progress, self.report.stamp_ns
            if body.stamp_ns < since_ns:
                return  # a look from before a report may show the unit short of the progress that it told of
        # The end of a route may be where it begins; one that is pushed aside as it sets off is seen there.
        driven = from_m + self.fastest_mps * seconds(max(body.stamp_ns - since_ns, 0)) + _SEEN_AHEAD_M
        high = min(self.limit + SAME_M, driven)
        seen = self.track.seen_progress(body.X_WB, self.progress, high, _SEEN_OFF_M)
        if seen is not None:
            self._advance(seen - _SEEN_BACK_M, now_ns)

    def _advance(self, progress: float, now_ns: int) -> None:
        if progress > self.progress + 1e-3:
            self.moved_ns = self.patient_ns = now_ns
        self.progress = max(self.progress, progress)

    def set_out(self, track: Track, enters: tuple[str, str] | None, order: int, now_ns: int) -> None:
        """Begin a route, on which the unit may not drive yet."""
        self.state, self.route, self.order, self.track = UnitState.UNDER_WAY, self.route + 1, order, track
        self.limit, self.progress, self.patient_ns, self.granted_ns = -1.0, 0.0, now_ns, now_ns
        self.enters, self.seat, self.unlocks = enters, None, self.holder is not None
        self.held, self.reason = False, ""

    def stand(self, now_ns: int, reason: str, state: UnitState | None = None) -> None:
        """End the route of a unit that stands still, idle or docked unless another state is given."""
        if self.track is not None and self.seen_ns < self.moved_ns:
            self.X_WU, self.sight = self.track.at(self.progress), None  # not seen since it came there
        self.state = state or (UnitState.IDLE if self.holder is None else UnitState.DOCKED)
        self.still_ns, self.reason, self.blocked_by = now_ns, reason, None

    def stand_down(self) -> None:
        """Replace the route of a unit that stands by one without legs, by which the unit goes on standby.

        Until then it would wait for the rest of the route that it knows of.
        """
        self.route, self.track, self.enters = self.route + 1, standing(self.pose, at_port=False), None
        self.limit, self.progress = 0.0, 0.0

    @property
    def destination(self) -> SE2:
        """Where the unit stands at the end of its route; where it is without one."""
        if not self.under_way or self.track is None:
            return self.pose
        return self.seat or self.track.end

    @property
    def resting_places(self) -> tuple[SE2, ...]:
        """Where the unit stands or will stand: of one that may go on by itself, both."""
        if self.may_go_on and self.track is not None:
            return self.pose, self.track.end
        return (self.destination,)

    @property
    def docks(self) -> tuple[tuple[str, str], ...]:
        """Unit and port that the unit is locked to, and those at which its route ends or may have ended."""
        ports = dict.fromkeys((self.holder, self.enters if self.under_way or self.may_go_on else None))
        return tuple(port for port in ports if port is not None)
