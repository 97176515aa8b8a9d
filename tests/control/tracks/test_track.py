"""Tracks: the axle trails the controlled point, and legs at ports bend to where the ports are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.path_following.path import Path
from msrr_control.tracks.track import (
    SPACING_M,
    Track,
    TrackBuilder,
    standing,
    track_of,
)
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.messages import GlobalPose
from msrr_scenes.messages.coordination import LegKind, UnitMode, UnitReport, UnitState

OFFSET = 0.1


def _tip(X: SE2) -> np.ndarray:
    return X.act([OFFSET, 0.0])


def _example() -> Track:
    builder = TrackBuilder(SE2(0.2, -0.1, 0.5), OFFSET)
    builder.back(0.3)
    builder.turn_to(2.0)
    X = builder.pose
    builder.follow(Path(np.array([X.x, X.y, 2.0]), np.array([1.5, 0.0]), np.array([0.8, 0.4])))
    builder.turn_to(0.0)
    builder.dock(builder.pose @ SE2(0.7, 0.0, 0.0), 0.7)
    return builder.track()


def test_the_legs_alone_give_the_track_again() -> None:
    track = _example()
    again = track_of(track.legs, SE2(*track.poses[0]), OFFSET)
    np.testing.assert_allclose(again.s, track.s, atol=1e-9)
    np.testing.assert_allclose(again.poses, track.poses, atol=1e-9)
    np.testing.assert_array_equal(again.at_port, track.at_port)


def test_arc_length_is_that_of_the_controlled_point() -> None:
    track = _example()
    assert float(np.diff(track.s).max()) < 1.4 * SPACING_M
    assert (np.diff(track.s) > 0.0).all()
    tips = np.array([_tip(SE2(*pose)) for pose in track.poses])
    way = float(np.linalg.norm(np.diff(tips, axis=0), axis=1).sum())
    assert track.length == pytest.approx(way, rel=0.01)


def test_the_unit_never_slips_sideways_and_its_point_stays_on_the_path() -> None:
    path = Path(np.array([0.0, 0.0, 0.3]), np.array([2.0, -1.0, 0.0]), np.array([0.6, 0.9, 0.5]))
    builder = TrackBuilder(SE2(0.0, 0.0, 0.3), OFFSET)
    builder.follow(path)
    track = builder.track()
    for a, b in zip(track.poses, track.poses[1:], strict=False):
        moved = SE2(*a).inverse() @ SE2(*b)
        assert abs(moved.y - 0.5 * moved.x * moved.yaw) < 2e-4
        assert moved.x > -1e-6
    for s, pose in zip(track.s, track.poses, strict=True):
        beside = 0.5 * 2.0 * OFFSET**2 + 1e-3 if s < 0.2 else 1e-9  # it begins where the path has bent off
        np.testing.assert_allclose(_tip(SE2(*pose)), path.at(s + OFFSET).point, atol=beside)


def test_backwards_it_keeps_its_heading() -> None:
    start = SE2(0.3, -0.2, 2.0)
    builder = TrackBuilder(start, OFFSET)
    builder.reverse(0.25)
    track = builder.track()
    assert track.length == pytest.approx(0.25)
    for s, pose in zip(track.s, track.poses, strict=True):
        np.testing.assert_allclose(pose, (start @ SE2(-s, 0.0, 0.0)).as_array(), atol=1e-12)
    again = track_of(track.legs, start, OFFSET)
    np.testing.assert_allclose(again.poses, track.poses)
    assert [leg.kind for leg in again.legs] == [LegKind.REVERSE]
    builder.reverse(0.1)
    assert track_of(builder.track().legs, start, OFFSET).length == pytest.approx(0.35)


def test_a_dock_leg_ends_in_the_port() -> None:
    X_WE = SE2(0.4, 0.2, -1.0)
    builder = TrackBuilder(X_WE @ SE2(-0.7, 0.0, 0.05), OFFSET)
    builder.dock(X_WE, 0.7)
    end = builder.track().end
    assert math.hypot(end.x - X_WE.x, end.y - X_WE.y) < 1e-4
    assert abs(wrap_angle(end.yaw - X_WE.yaw)) < 1e-4
    assert builder.track().legs[-1].kind is LegKind.DOCK
    assert builder.track().dock_start == 0.0


def test_between_samples_a_track_goes_on_evenly_and_beyond_its_ends_it_stays() -> None:
    start = SE2(0.2, -0.1, 3.0)
    builder = TrackBuilder(start, OFFSET)
    builder.ahead(0.5)
    builder.turn_to(-3.0)
    track = builder.track()
    assert track.length == pytest.approx(0.5 + OFFSET * (2.0 * math.pi - 6.0)), (
        "it does not turn the short way"
    )
    for s in (-1.0, 0.0, 0.011, 0.25, 0.49):
        X = start @ SE2(max(s, 0.0), 0.0, 0.0)
        np.testing.assert_allclose(track.at(s).as_array(), X.as_array(), atol=1e-9)
    half = track.at(0.5 * (track.s[-2] + track.length)).yaw
    assert half == pytest.approx(0.5 * (track.poses[-2, 2] + track.poses[-1, 2]))
    assert track.at(9.0) == track.end


@pytest.mark.parametrize("beyond", [0.004, 0.05, 0.1, 0.3])
def test_however_short_a_path_its_track_ends_on_it(beyond: float) -> None:
    path = Path(np.zeros(3), np.array([2.0]), np.array([OFFSET + beyond]))
    builder = TrackBuilder(SE2(), OFFSET)
    builder.follow(path)
    np.testing.assert_allclose(_tip(builder.pose), path.at(math.inf).point, atol=1e-6)


@pytest.mark.parametrize("X", [SE2(), SE2(0.01, -0.02, 0.03), SE2(-0.02, 0.01, -0.05), SE2(0.0, 0.0, 6.28)])
def test_a_dock_leg_that_is_bent_ends_at_the_port_and_begins_where_it_began(X: SE2) -> None:
    track = _example()
    X_WE = track.end @ X
    bent = track.to_port(X_WE)
    assert math.hypot(bent.end.x - X_WE.x, bent.end.y - X_WE.y) < 1e-12
    assert abs(wrap_angle(bent.end.yaw - X_WE.yaw)) < 1e-12
    assert bent.legs == track.legs
    before = track.s <= track.dock_start
    np.testing.assert_array_equal(bent.poses[before], track.poses[before])
    share = (track.s[~before] - track.dock_start) / (track.length - track.dock_start)
    moved = np.hypot(*(bent.poses - track.poses)[~before, :2].T)
    most = math.hypot(X.x, X.y) + abs(wrap_angle(X.yaw)) * (track.length - track.s[~before])
    assert np.all(moved <= share * most + 1e-12), "the bend does not begin with nothing"
    back = bent.to_port(track.end)
    np.testing.assert_allclose(back.end.as_array(), track.end.as_array(), atol=1e-12)


def test_a_track_without_a_leg_into_a_port_is_not_bent() -> None:
    builder = TrackBuilder(SE2(0.2, -0.1, 0.5), OFFSET)
    builder.ahead(0.5)
    track = builder.track()
    np.testing.assert_array_equal(track.to_port(SE2(3.0, 2.0, 1.0)).poses, track.poses)


def test_a_seen_pose_is_found_on_its_track_and_nowhere_else() -> None:
    track = _example()
    for s in (0.1, 0.5, 1.0, track.length - 0.1):
        seen = track.seen_progress(track.at(s), 0.0, track.length, 0.06)
        assert seen == pytest.approx(s, abs=SPACING_M)
        assert track.seen_progress(track.at(s) @ SE2(0.0, 0.2, 0.0), s - 0.05, s + 0.05, 0.06) is None
    assert standing(SE2(1.0, 2.0, 0.3)).at(5.0) == SE2(1.0, 2.0, 0.3)


def _out_and_back() -> Track:
    """A track that turns round, leads off, turns round and leads back, past where it begins."""
    builder = TrackBuilder(SE2(0.5, 0.4, -2.4), OFFSET)
    for way in (0.3, 0.6):
        builder.turn_by(-math.pi)
        builder.follow(Path(builder.pose.as_array(), np.zeros(1), np.array([way + OFFSET])))
    return builder.track()


def _back_and_ahead() -> Track:
    """A track that leads out of a port, and on ahead over nearly the same ground."""
    builder = TrackBuilder(SE2(0.5, 0.4, -2.4), OFFSET)
    builder.back(0.45)
    builder.turn_by(-0.04)
    builder.ahead(0.7)
    return builder.track()


@pytest.mark.parametrize(("track", "behind"), [(_out_and_back(), 0.06), (_back_and_ahead(), 0.2)])
def test_a_unit_that_comes_by_again_is_not_held_for_further_than_it_is(track: Track, behind: float) -> None:
    """Law: what is seen is where the unit is, set back by 6 cm behind it, even where the track passes twice.

    The progress that a unit is seen to have frees ground for others, so that one too large lets them come so
    near that neither can move.
    """
    known, rng = 0.0, np.random.default_rng(3)
    np.testing.assert_allclose(track_of(track.legs, track.at(0.0), OFFSET).poses, track.poses, atol=1e-9)
    for s in np.repeat(np.arange(0.0, track.length, 0.02), 5).tolist():
        X_WU = track.at(s) @ SE2(*rng.uniform([-0.01, -0.01, -0.05], [0.01, 0.01, 0.05]).tolist())
        seen = track.seen_progress(X_WU, known, track.length, 0.06)
        assert seen is not None
        assert s - behind < seen < s + 0.06
        known = max(known, seen - 0.06)


def test_a_unit_that_is_pushed_as_it_sets_off_has_not_come_to_the_end_of_its_route() -> None:
    """Where a route leads back to its beginning, that sight freed all ground which it had still to drive."""
    X_WU = SE2(0.683, 0.776, 1.5708)
    builder = TrackBuilder(X_WU, OFFSET)
    for turn, way in ((0.0, 0.5), (-math.pi, 1.0), (-math.pi, 0.55)):
        if turn:
            builder.turn_by(turn)
        builder.follow(Path(builder.pose.as_array(), np.zeros(1), np.array([way])))
    track = builder.track()
    known = []
    for fastest_mps in (math.inf, 0.44):
        unit = UnitRecord("a", state=UnitState.UNDER_WAY, route=1, track=track, limit=track.length)
        unit.progress, unit.fastest_mps = 0.004, fastest_mps
        for k in range(30):
            aside = track.at(0.004) @ SE2(-0.045, 0.002 * k - 0.03, 0.0)
            unit.observe(GlobalPose("a", 100_000_000, aside, 1e-6 * np.eye(3)), 150_000_000)
        known.append(unit.progress)
    assert known[0] > 1.0, "the track does not lead past where it begins"
    assert known[1] < 0.1


def test_a_look_from_before_a_report_tells_nothing_of_progress() -> None:
    """It shows the unit where it was, and the track may pass there again."""
    track = _out_and_back()
    unit = UnitRecord("a", state=UnitState.UNDER_WAY, route=1, track=track, limit=track.length)
    unit.receive(UnitReport("a", 2_000_000_000, 1, 1, 0.2, UnitMode.DRIVING, None), 2_100_000_000)
    for stamp_ns, s, known in ((1_000_000_000, 0.0, 0.2), (3_000_000_000, 0.5, 0.44)):
        unit.observe(GlobalPose("a", stamp_ns, track.at(s), 1e-6 * np.eye(3)), stamp_ns + 1_500_000_000)
        assert unit.progress == pytest.approx(known, abs=SPACING_M)
