"""The unit's side: the newest authority counts, and the unit stops where it ends, radio or not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from msrr_control.path_following.path import Path
from msrr_control.tracks.authority import MovementAuthority
from msrr_control.tracks.track import TrackBuilder
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import Authority, RouteLeg
from msrr_scenes.specs.vehicle import LimitsSpec

LIMITS = LimitsSpec.model_validate({})
REACTION_S = 0.12


def _legs() -> tuple[RouteLeg, ...]:
    builder = TrackBuilder(SE2(), 0.1)
    builder.turn_to(1.0)
    builder.follow(Path(np.array([0.0, 0.0, 1.0]), np.zeros(1), np.array([1.1])))
    builder.turn_to(0.0)
    builder.dock(builder.pose @ SE2(0.7, 0.0, 0.0), 0.7)
    return builder.track().legs


def _authority(limit: float, seq: int = 1, route: int = 1, expires_ns: int = 10**15) -> Authority:
    return Authority("a", route, seq, 0, expires_ns, limit, _legs(), "b.rear", unlock=False)


def test_without_radio_it_stops_at_once_and_before_the_limit() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    held.receive(_authority(1.7, expires_ns=2_000_000_000))
    assert held.limit(1_999_999_999, 0.5, 0.4) == 1.7
    stop = held.limit(2_000_000_000, 0.5, 0.4)
    braking = 0.4**2 / (2.0 * LIMITS.a_max_mps2)
    assert 0.5 + 0.4 * REACTION_S + braking < stop < 0.5 + 0.4 * REACTION_S + 1.5 * braking
    assert held.limit(2_100_000_000, 0.54, 0.3) == stop  # it does not move once it is set
    assert not held.receive(_authority(1.7, expires_ns=2_000_000_000))
    assert held.limit(2_150_000_000, 0.56, 0.3) == stop  # nor by the same message once more
    held.receive(_authority(1.7, seq=2, expires_ns=4_000_000_000))
    assert held.limit(2_200_000_000, 0.58, 0.2) == 1.7


def test_near_the_limit_an_expired_authority_ends_at_the_limit() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    held.receive(_authority(0.52, expires_ns=0))
    assert held.limit(1, 0.5, 0.3) == 0.52
    assert held.limit(2, 0.5, 0.0) == 0.52  # it does not move once it is set


def test_in_the_dock_leg_silence_does_not_stop_the_unit() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    length = _legs()[-1].end
    held.receive(_authority(length, expires_ns=0))
    assert held.length == length
    assert held.limit(1, held.dock_start + 0.01, 0.1) == length
    assert held.limit(1, held.dock_start - 0.3, 0.0) < held.dock_start
    held.receive(_authority(held.dock_start, seq=2, expires_ns=0))
    assert held.limit(1, held.dock_start, 0.1) == held.dock_start


def test_in_the_open_silence_stops_the_unit_in_its_last_leg_as_well() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    first, last = _legs()[:2]
    held.receive(replace(_authority(last.end, expires_ns=0), legs=(first, last), to=None))
    assert held.dock_start == held.length == last.end
    assert held.limit(1, first.end + 0.1, 0.1) < last.end
    held.receive(replace(_authority(0.0, seq=2), legs=(), to=None))
    assert held.dock_start == held.length == 0.0


def test_a_dock_leg_is_not_begun_by_an_expired_authority() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    held.receive(_authority(_legs()[-1].end, expires_ns=1_000_000_000))
    assert held.limit(999_999_999, held.dock_start, 0.0) == held.length
    assert held.limit(1_000_000_000, held.dock_start, 0.0) == held.dock_start
    held.receive(_authority(held.length, seq=2, expires_ns=4_000_000_000))
    assert held.limit(1_500_000_000, held.dock_start, 0.0) == held.length


def test_the_newest_counts_in_whatever_order_they_arrive() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    assert held.limit(0, 0.3, 0.0) == 0.3
    assert held.newest is None
    messages = [_authority(0.1 * k, seq=k, route=1 + k // 6) for k in range(1, 9)]
    order = np.random.default_rng(0).permutation(8)
    begins = [held.receive(messages[k]) for k in order]
    assert held.newest is messages[-1]
    assert 1 <= sum(begins) <= 2
    assert held.limit(0, 0.0, 0.0) == pytest.approx(0.8)


def test_only_another_route_begins_anew() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    assert held.legs == ()
    assert held.length == held.dock_start == 0.0
    assert held.receive(_authority(0.1, seq=1))
    assert not held.receive(_authority(0.2, seq=2))
    assert held.receive(_authority(0.1, seq=3, route=2))


def test_a_dock_leg_begins_where_the_leg_before_it_ends() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    held.receive(_authority(0.0))
    assert held.length - held.dock_start == pytest.approx(0.7)
    held.receive(replace(_authority(0.0, seq=2), legs=_legs()[-1:]))
    assert held.dock_start == 0.0 < held.length


def test_a_dock_leg_granted_in_part_is_not_driven_in_silence() -> None:
    held = MovementAuthority(LIMITS, REACTION_S)
    part = _legs()[-1].end - 0.1
    held.receive(_authority(part, expires_ns=0))
    assert held.limit(1, held.dock_start + 0.1, 0.1) < part


def test_after_a_failed_attempt_in_silence_it_stays_before_the_dock_leg() -> None:
    """It ran into the leg as it braked; where it would have stopped then does not count any more."""
    held = MovementAuthority(LIMITS, REACTION_S)
    held.receive(_authority(_legs()[-1].end, expires_ns=0))
    begins = held.dock_start
    assert held.limit(1, begins - 0.01, 0.3) > begins
    assert held.limit(2, begins + 0.02, 0.2) == held.length
    assert held.limit(3, begins - 0.1, 0.0) == begins - 0.1


@pytest.mark.parametrize("backs", [False, True])
@pytest.mark.parametrize("turn", [-2.5, 0.0, 0.8])
def test_a_route_in_the_open_ends_in_the_heading_of_its_track(turn: float, backs: bool) -> None:
    builder = TrackBuilder(SE2(0.3, 0.2, 1.0), 0.1)
    builder.ahead(0.5)
    builder.turn_by(turn)
    if backs:
        builder.reverse(0.3)
    held = MovementAuthority(LIMITS, REACTION_S)
    held.receive(replace(_authority(0.0), legs=builder.track().legs, to=None))
    assert held.end_yaw == pytest.approx(builder.pose.yaw)


@pytest.mark.parametrize("turn", [-1.2, 0.7])
def test_a_route_in_the_open_ends_in_the_heading_after_a_bend(turn: float) -> None:
    """The axle trails the point that follows the path: after a line of 0.8 m by hardly anything."""
    bend = Path(
        np.array([0.0, 0.0, 0.4]),
        np.array([math.copysign(1.0 / 0.3, turn), 0.0]),
        np.array([0.3 * abs(turn), 0.8]),
    )
    builder = TrackBuilder(SE2(0.0, 0.0, 0.4), 0.1)
    builder.follow(bend)
    held = MovementAuthority(LIMITS, REACTION_S)
    held.receive(replace(_authority(0.0), legs=builder.track().legs, to=None))
    assert held.end_yaw == pytest.approx(0.4 + turn)
    assert builder.pose.yaw == pytest.approx(held.end_yaw, abs=1e-3)
