"""Recalls: who is recalled and when, and when one that was recalled stands for certain."""

from __future__ import annotations

from dataclasses import replace

import pytest

from msrr_control.coordination.ledger import SAME_M, UnitRecord
from msrr_control.coordination.mission import Patience
from msrr_control.coordination.recall import Recall
from msrr_control.tracks.track import Track, TrackBuilder
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitMode, UnitReport, UnitState

PATIENCE = Patience()
S = 1_000_000_000


def _into_a_port() -> Track:
    """A way of 1 m ahead and 0.7 m into a port."""
    builder = TrackBuilder(SE2(), 0.1)
    builder.ahead(1.0)
    builder.dock(builder.pose @ SE2(0.7, 0.0, 0.0), 0.7)
    return builder.track()


TRACK = _into_a_port()


def _held(now_s: float, progress: float = 0.2, limit: float = 0.9) -> UnitRecord:
    """A unit that has been standing since 0 s, and is heard."""
    unit = UnitRecord("a", SE2(), state=UnitState.UNDER_WAY, route=1, track=TRACK, limit=limit)
    unit.progress = progress
    _hear(unit, now_s)
    return unit


def _hear(unit: UnitRecord, now_s: float, mode: UnitMode = UnitMode.STANDING) -> None:
    unit.heard_ns = round(now_s * S)
    unit.report = UnitReport("a", unit.heard_ns, 1, unit.route, unit.progress, mode, None)


def _stops(recall: Recall, unit: UnitRecord, now_s: float, lane_closed: bool = False) -> bool:
    return recall.has_stopped(unit, round(now_s * S), lane_closed)


LONG_S = PATIENCE.held_s + 0.1


@pytest.mark.parametrize(
    ("change", "recalled"),
    [
        ({}, True),
        ({"patient_ns": round(0.2 * S)}, False),
        ({"limit": 0.2 + 0.8 * SAME_M}, False),  # it waits for others
        ({"limit": 0.2 + 1.2 * SAME_M}, True),
        (
            {"progress": TRACK.dock_start - 0.8 * SAME_M, "limit": TRACK.length},
            False,
        ),  # it is in its dock leg
        ({"progress": TRACK.dock_start - 1.2 * SAME_M, "limit": TRACK.length}, True),
        ({"heard_ns": round((LONG_S - PATIENCE.silent_s - 0.1) * S)}, False),  # nobody can know
        ({"heard_ns": round((LONG_S - PATIENCE.silent_s + 0.1) * S)}, True),
        ({"state": UnitState.IDLE}, False),
        ({"expired": True}, False),  # it drives on when the next authority arrives
        ({"track": None}, False),
    ],
)
def test_a_unit_is_recalled_that_is_held_for_long_and_could_drive_on(
    change: dict[str, object], recalled: bool
) -> None:
    unit, recall = _held(LONG_S), Recall(PATIENCE)
    for name, value in change.items():
        setattr(unit, name, value)
    assert not _stops(recall, unit, LONG_S)
    assert recall.is_recalled(unit) is recalled


def test_one_that_was_recalled_has_stopped_when_it_stands_and_its_authority_has_expired() -> None:
    unit, recall = _held(LONG_S), Recall(PATIENCE)
    _stops(recall, unit, LONG_S)
    expired_s = LONG_S + PATIENCE.expires_s
    _hear(unit, expired_s)
    assert not _stops(recall, unit, expired_s + 1.0), "it may drive on after a report of that instant"
    _hear(unit, expired_s + 0.1, UnitMode.DRIVING)
    assert not _stops(recall, unit, expired_s + 1.0)
    assert recall.is_recalled(unit)
    _hear(unit, expired_s + 0.1)
    assert _stops(recall, unit, expired_s + 1.0)
    assert not recall.is_recalled(unit)


@pytest.mark.parametrize("lane_closed", [False, True])
def test_one_that_drives_on_after_all_may_unless_its_lane_is_closed(lane_closed: bool) -> None:
    unit, recall = _held(LONG_S), Recall(PATIENCE)
    _stops(recall, unit, LONG_S, lane_closed)
    assert recall.is_recalled(unit)
    unit.moved_ns = round((LONG_S + 0.5) * S)
    assert not _stops(recall, unit, LONG_S + 1.0, lane_closed)
    assert recall.is_recalled(unit) is lane_closed
    unit.state = UnitState.FAILED
    assert not _stops(recall, unit, LONG_S + 2.0, lane_closed)
    assert not recall.is_recalled(unit)


def test_one_whose_lane_is_closed_is_recalled_as_it_drives() -> None:
    unit, recall = _held(1.0), Recall(PATIENCE)
    _hear(unit, 1.0, UnitMode.DRIVING)
    assert not _stops(recall, unit, 1.0)
    assert not recall.is_recalled(unit)
    assert not _stops(recall, unit, 1.1, lane_closed=True)
    assert recall.is_recalled(unit)
    idle, other = _held(1.0), Recall(PATIENCE)
    idle.state = UnitState.IDLE
    _stops(other, idle, 1.1, lane_closed=True)
    assert not other.is_recalled(idle)


@pytest.mark.parametrize("recalls", [0, 1, 3])
def test_a_unit_that_is_held_is_recalled_so_often_and_then_no_more(recalls: int) -> None:
    """Those whose lane is closed, or whose target is elsewhere, are another matter, and do not count."""
    recall, now_s, counted = Recall(replace(PATIENCE, recalls=recalls)), LONG_S, 0

    def stops(lane_closed: bool) -> bool:
        nonlocal now_s, counted
        unit = _held(now_s)
        unit.recalls = counted
        _stops(recall, unit, now_s, lane_closed)
        now_s += PATIENCE.expires_s + 0.1
        _hear(unit, now_s)
        stopped, counted = _stops(recall, unit, now_s, lane_closed), unit.recalls
        return stopped

    assert all(stops(lane_closed=True) for _ in range(recalls + 1))
    times = [stops(lane_closed=False) for _ in range(recalls + 2)]
    assert times == [True] * recalls + [False] * 2
    assert stops(lane_closed=True)


def test_one_that_was_never_heard_has_not_stopped() -> None:
    unit, recall = _held(0.0), Recall(PATIENCE)
    unit.report = None
    assert not _stops(recall, unit, 1.0, lane_closed=True)
    assert recall.is_recalled(unit)
    assert not _stops(recall, unit, 2.0 + PATIENCE.expires_s, lane_closed=True)
    assert recall.is_recalled(unit)


@pytest.mark.parametrize("mode", [UnitMode.STANDING, UnitMode.DOCKED, UnitMode.DRIVING])
def test_one_that_has_not_heard_of_its_route_has_stopped_where_the_one_before_ended(mode: UnitMode) -> None:
    """It was never sent an authority again, and failed for making no progress once it could be heard."""
    unit, recall = _held(1.0), Recall(PATIENCE)
    unit.route = 2
    assert not _stops(recall, unit, 1.0, lane_closed=True)
    for now_s, stopped in (
        (PATIENCE.expires_s, False),
        (1.1 + PATIENCE.expires_s, mode is not UnitMode.DRIVING),
    ):
        unit.report = UnitReport("a", round(now_s * S), 1, 1, 0.0, mode, None)
        assert _stops(recall, unit, now_s + 0.1, lane_closed=True) is stopped
