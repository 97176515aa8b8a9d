"""Single judgements of the watch, each with a record made for that judgement alone."""

from __future__ import annotations

import math

import pytest

from msrr_control.coordination.goal_tolerance import DEFAULT_TOLERANCE, GoalTolerance
from msrr_control.coordination.ledger import SAME_M, UnitRecord
from msrr_control.coordination.mission import Patience
from msrr_control.coordination.watch import Watch
from msrr_control.tracks.track import Track, TrackBuilder, standing
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitMode, UnitReport, UnitState

PATIENCE = Patience()
S = 1_000_000_000
STEP_S = 0.5
LOST_S, EXPIRED_S = 10.0, 10.0 + PATIENCE.expires_s


def _told(mode: UnitMode, at_s: float, docked_to: str | None = None) -> UnitReport:
    return UnitReport("a", round(at_s * S), 1, 1, 0.0, mode, docked_to)


@pytest.mark.parametrize(
    ("mode", "told_s", "seen_s", "found"),
    [
        (UnitMode.STANDING, EXPIRED_S + 0.1, LOST_S + 0.1, True),
        (UnitMode.STANDING, EXPIRED_S - 0.1, LOST_S + 0.1, False),  # it may drive on by its last authority
        (UnitMode.LOST, LOST_S + 0.2, LOST_S + 0.1, True),  # one that says so stays there
        (UnitMode.LOST, LOST_S + 0.2, LOST_S - 0.1, False),
        (UnitMode.STANDING, EXPIRED_S + 0.1, LOST_S - 0.1, False),
        (UnitMode.DRIVING, EXPIRED_S + 9.0, EXPIRED_S + 9.0, False),
        (UnitMode.DOCKING, EXPIRED_S + 9.0, EXPIRED_S + 9.0, False),
        (UnitMode.STANDING, LOST_S - 0.1, EXPIRED_S + 9.0, False),
    ],
)
def test_a_lost_unit_is_found_where_it_stands_heard_and_seen(
    mode: UnitMode, told_s: float, seen_s: float, found: bool
) -> None:
    unit = UnitRecord("a", SE2(), state=UnitState.LOST, route=1, still_ns=round(LOST_S * S))
    assert not Watch(PATIENCE).is_found(unit)
    unit.report, unit.seen_ns = _told(mode, told_s), round(seen_s * S)
    assert Watch(PATIENCE).is_found(unit) is found


def test_a_lost_unit_in_a_port_is_found_unseen() -> None:
    """In the one that it was to enter at once; in another one when its last authority has ended.

    One on its way out of a port tells that it is docked until it is clear, and was told to leave it again.
    """
    for enters, unlocks, route, told_s, found in (
        (("b", "rear"), False, 1, LOST_S + 0.1, True),
        (None, False, 1, LOST_S + 0.1, False),
        (None, False, 1, EXPIRED_S + 0.1, True),
        (None, True, 1, EXPIRED_S + 9.0, False),
        (None, True, 2, EXPIRED_S + 0.1, True),  # it has not heard of the route that leads out
    ):
        unit = UnitRecord("a", SE2(), state=UnitState.LOST, route=route, still_ns=round(LOST_S * S))
        unit.holder, unit.enters, unit.unlocks = ("b", "rear"), enters, unlocks
        unit.report = _told(UnitMode.DOCKED, told_s, "b.rear")
        assert Watch(PATIENCE).is_found(unit) is found


@pytest.mark.parametrize(("short_m", "waits"), [(0.0, True), (10.0 * SAME_M, False)])
def test_one_that_hears_nothing_waits_where_its_authority_ends_and_not_short_of_it(
    short_m: float, waits: bool
) -> None:
    """It kept its route for ever, and with it the ground on which others were to drive."""
    unit = UnitRecord("a", SE2(), state=UnitState.UNDER_WAY, route=1, limit=0.5, progress=0.5 - short_m)
    unit.report, unit.expired = _told(UnitMode.STANDING, EXPIRED_S), True
    assert Watch(PATIENCE).waits(unit) is waits


@pytest.mark.parametrize("turned", [-1.0, 1.0])
@pytest.mark.parametrize("tolerance", [DEFAULT_TOLERANCE, DEFAULT_TOLERANCE.widened(0.002, 0.04)])
def test_a_move_is_done_by_place_and_by_heading(turned: float, tolerance: GoalTolerance) -> None:
    end, far, askew = SE2(0.3, -0.2, 2.0), tolerance.xy_m, turned * tolerance.yaw_rad
    unit = UnitRecord("a", state=UnitState.UNDER_WAY, track=standing(end), seen_ns=2, moved_ns=1)
    for share, there in ((0.9, True), (1.1, False)):
        for off in (SE2(0.0, share * far, 0.0), SE2(-share * far, 0.0, 0.0), SE2(0.0, 0.0, share * askew)):
            unit.X_WU = end @ off
            assert Watch(PATIENCE, tolerance).is_at_end(unit) is there
    unit.seen_ns = 0  # nobody saw where it has come to: its own word has to do
    assert Watch(PATIENCE).is_at_end(unit)


def _into_a_port() -> Track:
    """A way of 1 m ahead and 0.7 m into a port."""
    builder = TrackBuilder(SE2(), 0.1)
    builder.ahead(1.0)
    builder.dock(builder.pose @ SE2(0.7, 0.0, 0.0), 0.7)
    return builder.track()


TRACK = _into_a_port()
END = TRACK.length


def _under_way(progress: float, limit: float, mode: UnitMode = UnitMode.STANDING) -> UnitRecord:
    unit = UnitRecord("a", SE2(), state=UnitState.UNDER_WAY, route=1, track=TRACK)
    unit.limit, unit.progress, unit.report = limit, progress, UnitReport("a", 1, 1, 1, progress, mode, None)
    return unit


@pytest.mark.parametrize(
    ("progress", "limit", "moves", "heard", "fails_s"),
    [
        (0.2, 0.9, False, True, PATIENCE.lost_s),
        (0.2, 0.2 + 1.2 * SAME_M, False, True, PATIENCE.lost_s),
        (0.2, 0.2 + 0.8 * SAME_M, False, True, math.inf),  # it waits for others
        (0.2, 0.9, False, False, math.inf),  # nobody can know
        (0.2, END, False, True, PATIENCE.lost_s),
        (1.2, END, False, True, PATIENCE.dock_s),
        (END, END, False, True, PATIENCE.dock_s),
        (END, END, True, True, math.inf),  # it tries again
        (1.2, END, True, True, math.inf),  # and has not come to the port before
    ],
)
def test_a_unit_fails_that_could_go_on_and_does_not(
    progress: float, limit: float, moves: bool, heard: bool, fails_s: float
) -> None:
    unit, watch = _under_way(progress, limit), Watch(PATIENCE)
    unit.enters = ("b", "rear")
    stopping = ((0.0, 0.0, 0.0),) if moves else ()
    unit.report = UnitReport("a", 1, 1, 1, progress, UnitMode.STANDING, None, stopping=stopping)
    failed_s = math.inf
    for k in range(1, 400):
        now_ns = round(k * STEP_S * S)
        unit.heard_ns = now_ns if heard else 0
        if watch.stagnation(unit, now_ns) is not None:
            failed_s = k * STEP_S
            break
        watch.advance(now_ns)
    assert failed_s == fails_s + (0.0 if math.isinf(fails_s) else STEP_S)


def test_a_unit_that_looks_for_its_port_between_attempts_has_as_long_each_time() -> None:
    """It counted as failed by the time of all its searches together."""
    unit, watch, now_s = _under_way(END, END), Watch(PATIENCE), 0.0
    unit.enters = ("b", "rear")
    for looks_s in (0.9 * PATIENCE.dock_s, 0.9 * PATIENCE.dock_s, 1.1 * PATIENCE.dock_s):
        told = []
        for k in range(round((looks_s + 5.0) / STEP_S)):
            now_s += STEP_S
            unit.heard_ns = round(now_s * S)
            stopping = ((0.0, 0.0, 0.0),) if k * STEP_S < 5.0 else ()
            unit.report = UnitReport("a", unit.heard_ns, 1, 1, END, UnitMode.DOCKING, None, stopping=stopping)
            told.append(watch.stagnation(unit, unit.heard_ns))
            watch.advance(unit.heard_ns)
        assert any(told) is (looks_s > PATIENCE.dock_s)


def test_who_waits_has_come_to_rest_at_its_limit_or_may_not_begin() -> None:
    assert Watch(PATIENCE).waits(_under_way(0.5, 0.5))
    assert Watch(PATIENCE).waits(_under_way(0.0, -1.0, UnitMode.DOCKED))
    assert not Watch(PATIENCE).waits(_under_way(0.5, 0.9))
    assert not Watch(PATIENCE).waits(_under_way(0.5, 0.5, UnitMode.DRIVING))
    assert not Watch(PATIENCE).waits(_under_way(0.0, 0.5, UnitMode.DOCKED))
    assert not Watch(PATIENCE).waits(_under_way(END, END)), "nobody is waited for in a dock leg"
    over = _under_way(0.5, 0.5)
    over.state = UnitState.IDLE
    assert not Watch(PATIENCE).waits(over)


@pytest.mark.parametrize(
    ("state", "seen", "may"),
    [
        (UnitState.LOST, True, True),
        (UnitState.IDLE, False, True),
        (UnitState.IDLE, True, False),
        (UnitState.FAILED, False, False),
    ],
)
def test_who_is_out_of_sight_may_be_found_for_a_while(state: UnitState, seen: bool, may: bool) -> None:
    unit = UnitRecord("a", SE2() if seen else None, state=state, still_ns=S)
    for after_s, within in ((PATIENCE.lost_s - 0.1, True), (PATIENCE.lost_s + 0.1, False)):
        assert Watch(PATIENCE).may_be_found(unit, round((1.0 + after_s) * S)) is (may and within)


def test_a_unit_has_arrived_that_rests_at_the_end_once_somebody_has_looked_or_has_had_the_time_to() -> None:
    unit, moved_s = _under_way(END - 0.8 * SAME_M, END), 10.0
    unit.moved_ns = round(moved_s * S)
    there, elsewhere = TRACK.at(unit.progress), TRACK.at(unit.progress) @ SE2(0.1, 0.0, 0.0)
    for unit.X_WU, seen_s, now_s, arrived in (
        (there, moved_s - 1.0, moved_s + PATIENCE.unseen_s - 0.1, False),
        (there, moved_s - 1.0, moved_s + PATIENCE.unseen_s + 0.1, True),
        (there, moved_s + 0.1, moved_s + 0.2, True),
        (elsewhere, moved_s + 0.1, moved_s + PATIENCE.unseen_s - 0.1, False),  # it may correct that
        (elsewhere, moved_s + 0.1, moved_s + PATIENCE.unseen_s + 0.1, True),
    ):
        unit.seen_ns = round(seen_s * S)
        assert Watch(PATIENCE).has_arrived(unit, round(now_s * S)) is arrived
    short = _under_way(END - 1.2 * SAME_M, END)
    short.X_WU = TRACK.end
    assert not Watch(PATIENCE).has_arrived(short, round(20.0 * S))
    unit.route = 2
    assert not Watch(PATIENCE).has_arrived(unit, round(20.0 * S)), "that report is of another route"


def test_the_time_for_which_a_unit_had_to_wait_does_not_count_and_no_more_than_that() -> None:
    unit, watch = _under_way(0.2, 0.2), Watch(PATIENCE)
    waited_s, failed_s = 40.0, 0.0
    while failed_s < 200.0:
        failed_s += STEP_S
        unit.heard_ns = round(failed_s * S)
        unit.limit = 0.2 if failed_s <= waited_s else 0.9
        if watch.stagnation(unit, unit.heard_ns) is not None:
            break
        watch.advance(unit.heard_ns)
    assert failed_s == waited_s + PATIENCE.lost_s + STEP_S


@pytest.mark.parametrize(
    ("progress", "most_s"),
    [
        (0.2, PATIENCE.unheard_s),
        (TRACK.dock_start - 1.2 * SAME_M, PATIENCE.unheard_s),
        (TRACK.dock_start - 0.8 * SAME_M, PATIENCE.dock_s),
        (1.2, PATIENCE.dock_s),
    ],
)
def test_a_unit_is_lost_that_is_not_heard_for_as_long_as_it_may_take(progress: float, most_s: float) -> None:
    unit = _under_way(progress, END)
    unit.heard_ns, unit.granted_ns = S, 2 * S
    assert Watch(PATIENCE).silence(unit, round((2.0 + most_s - 0.1) * S)) is None
    assert Watch(PATIENCE).silence(unit, round((2.0 + most_s + 0.1) * S)) == f"not heard for {most_s:.0f} s"


@pytest.mark.parametrize(
    ("seen_s", "progress", "back_m", "retreat_m", "short"),
    [
        (EXPIRED_S + 0.1, 0.6, 0.3, 0.45, True),
        (EXPIRED_S - 0.1, 0.6, 0.3, 0.45, False),  # it may drive on by its last authority
        (EXPIRED_S + 0.1, 0.6, 0.1, 0.45, False),  # it may wait for a sight of the port
        (EXPIRED_S + 0.1, 0.6, -0.5, 0.45, False),  # it was not seen on its way there
        (EXPIRED_S + 0.1, TRACK.dock_start, 0.3, 0.45, False),  # it said or was seen to be there before
        (EXPIRED_S + 0.1, 0.6, 0.3, 0.95, False),  # an attempt may have failed, and another one begin
    ],
)
def test_a_lost_unit_has_stopped_short_of_its_port_if_it_is_seen_farther_away_than_attempts_lead(
    seen_s: float, progress: float, back_m: float, retreat_m: float, short: bool
) -> None:
    """It is seen ``back_m`` before its dock leg."""
    unit = _under_way(progress, END)
    unit.state, unit.enters, unit.retreat_m = UnitState.LOST, ("b", "rear"), retreat_m
    unit.X_WU = TRACK.at(TRACK.dock_start) @ SE2(-back_m, 0.0, 0.0)
    unit.still_ns, unit.seen_ns = round(LOST_S * S), round(seen_s * S)
    assert Watch(PATIENCE).stopped_short(unit) is short
    unit.holder = ("c", "rear")
    assert not Watch(PATIENCE).stopped_short(unit), "it has not left its port"
    unit.holder, unit.report = None, UnitReport("a", 1, 1, 1, progress, UnitMode.LOST, None)
    assert not Watch(PATIENCE).stopped_short(unit), "it stays where it is, and keeps no port"
    unit.enters, unit.report = None, None
    assert not Watch(PATIENCE).stopped_short(unit)


def test_a_unit_has_arrived_in_a_port_once_it_is_locked_to_that_port() -> None:
    for mode, holder, arrived in (
        (UnitMode.DOCKED, ("b", "rear"), True),
        (UnitMode.STANDING, ("b", "rear"), False),
        (UnitMode.DOCKED, ("b", "left"), False),
        (UnitMode.STANDING, None, False),
    ):
        unit = _under_way(END, END, mode)
        unit.enters, unit.holder = ("b", "rear"), holder
        assert Watch(PATIENCE).has_arrived(unit, S) is arrived
        unit.route = 2
        assert not Watch(PATIENCE).has_arrived(unit, S), "that report is of another route"


@pytest.mark.parametrize(("short", "fails"), [(0.0, True), (0.1, False)])
def test_a_unit_that_may_drive_to_the_end_of_its_route_in_the_open_and_does_not_fails(
    short: float, fails: bool
) -> None:
    """Nobody is in its way there: it does not hear that it may; one that may drive no further waits."""
    builder = TrackBuilder(SE2(), 0.1)
    builder.ahead(1.0)
    unit = _under_way(builder.track().length - short - 0.8 * SAME_M, builder.track().length - short)
    unit.track, watch = builder.track(), Watch(PATIENCE)
    for k in range(1, 100):
        unit.heard_ns = round(k * STEP_S * S)
        told = watch.stagnation(unit, unit.heard_ns)
        assert (told is not None) is (fails and k * STEP_S > PATIENCE.lost_s)
        watch.advance(unit.heard_ns)
    if fails:
        assert told == f"no progress beyond {unit.progress:.2f} m in {PATIENCE.lost_s:.0f} s"
        unit.report = UnitReport("a", 1, 1, 1, unit.progress, UnitMode.STANDING, None, reason="wheel stuck")
        assert watch.stagnation(unit, unit.heard_ns) == f"{told}; it says 'wheel stuck'"


def test_time_in_which_nobody_is_under_way_or_before_something_happens_does_not_count() -> None:
    units, late_s = [_under_way(0.2, 0.2)], 20.0

    def stalls(watch: Watch, now_s: float) -> bool:
        units[0].heard_ns = round(now_s * S)
        return watch.nobody_moves(units, units[0].heard_ns)

    for begin in (lambda w: w.restart(round(late_s * S)), lambda w: w.nobody_moves([], round(late_s * S))):
        watch = Watch(PATIENCE)
        begin(watch)
        assert not stalls(watch, late_s + PATIENCE.stalled_s - 0.1)
        assert stalls(watch, late_s + PATIENCE.stalled_s + 0.1)


#: What may happen to one of two that wait for each other: its limit, its progress, how long it is silent.
EVENTS = {
    "ground to drive on": (0.2 + 1.2 * SAME_M, 0.2, 0.0),
    "a dock leg": (END, END, 0.0),
    "silence": (0.2, 0.2, PATIENCE.silent_s + 0.1),
    "motion": (0.2, 0.2, 0.0),
}


@pytest.mark.parametrize("event", [None, *EVENTS])
def test_nobody_moves_where_all_have_waited_for_each_other_for_long(event: str | None) -> None:
    """Whatever happens to one of them after 3 s lets the time begin anew."""
    late_s = PATIENCE.stalled_s + (0.0 if event is None else 3.0)
    for now_s, stalled in ((late_s - 0.1, False), (late_s + 0.1, True)):
        watch, units = Watch(PATIENCE), [_under_way(0.2, 0.2 + 0.8 * SAME_M) for _ in "ab"]
        units.append(UnitRecord("c", SE2(), limit=0.9))  # it is idle, and need not be heard
        for at_s in (3.0, now_s):
            limit, progress, silent_s = 0.2, 0.2, 0.0
            if event is not None and at_s == 3.0:
                limit, progress, silent_s = EVENTS[event]
                units[1].moved_ns = round(at_s * S) if event == "motion" else 0
            units[0].heard_ns, units[1].heard_ns = round(at_s * S), round((at_s - silent_s) * S)
            units[1].limit, units[1].progress = limit, progress
            result = watch.nobody_moves(units, round(at_s * S))
        assert result is stalled
    assert not watch.nobody_moves([], round(99.0 * S))
