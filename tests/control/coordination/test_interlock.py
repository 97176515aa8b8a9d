"""The interlock grants no ground that is of no use to a unit."""

from __future__ import annotations

import numpy as np

from msrr_control.coordination.interlock import Interlock
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.path_following.path import Path
from msrr_control.tracks.track import Track, TrackBuilder
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.coordination import UnitState


def _under_way(name: str, track: Track, order: int, holder: tuple[str, str] | None = None) -> UnitRecord:
    X_WU = SE2(*track.poses[0].tolist())
    unit = UnitRecord(name, X_WU, state=UnitState.UNDER_WAY, order=order, track=track)
    unit.holder, unit.unlocks = holder, holder is not None
    return unit


def test_a_unit_is_let_out_of_its_port_only_when_it_can_leave_it_whole(setup: CoordinationSetup) -> None:
    """It does not set off for a part of the way: said to be free to go, it counted as failed 30 s later."""
    body = setup.lanes.body
    out = TrackBuilder(SE2(0.2, 0.0, 0.0), body.offset)
    out.back(0.3)
    out.turn_to(1.5)
    leaves = _under_way("leaves", out.track(), 2, holder=("root", "rear"))
    across = TrackBuilder(SE2(-0.3, -0.4, 0.5 * np.pi), body.offset)
    across.follow(Path(across.pose.as_array(), np.zeros(1), np.array([1.2 + body.offset])))
    passes = _under_way("passes", across.track(), 1)
    X_WR = leaves.pose @ body.docked(SE2(), "rear").inverse()
    root = UnitRecord("root", X_WR, state=UnitState.DOCKED)
    interlock = Interlock({unit.name: unit for unit in (leaves, passes, root)}, body)
    needed = interlock.needed(passes, leaves)
    back = leaves.track.legs[0].end
    assert np.isneginf(needed[leaves.track.s < 0.1]).all(), "a part of the way out is free"
    assert not np.isneginf(needed[leaves.track.s <= back]).all(), "and a part is not"
    interlock.extend(leaves)
    assert (leaves.limit, leaves.blocked_by) == (-1.0, "passes")
    passes.progress = passes.track.length
    interlock.extend(leaves)
    assert leaves.limit == leaves.track.length


def test_the_way_of_a_lost_unit_is_free_once_it_is_known_to_have_stopped_short(
    setup: CoordinationSetup,
) -> None:
    """The ground on which it might go on stayed closed to all who had been barred from it before."""
    body = setup.lanes.body
    into = TrackBuilder(SE2(-1.2, 0.0, 0.0), body.offset)
    into.follow(Path(into.pose.as_array(), np.zeros(1), np.array([0.6 + body.offset])))
    into.dock(SE2(), 0.1)
    lost = _under_way("lost", into.track(), 1)
    lost.state, lost.enters, lost.still_ns, lost.limit = (
        UnitState.LOST,
        ("root", "rear"),
        10,
        into.track().length,
    )
    across = TrackBuilder(SE2(-0.25, -1.0, 0.5 * np.pi), body.offset)
    across.follow(Path(across.pose.as_array(), np.zeros(1), np.array([1.6 + body.offset])))
    passes = _under_way("passes", across.track(), 2)
    root = UnitRecord("root", SE2(0.2, 0.0, 0.0), state=UnitState.DOCKED)
    interlock = Interlock({unit.name: unit for unit in (lost, passes, root)}, body)
    interlock.extend(passes)
    assert lost.may_go_on
    assert (0.0 < passes.limit < passes.track.length, passes.blocked_by) == (True, "lost")
    lost.enters = None
    interlock.extend(passes)
    assert (passes.limit, passes.blocked_by) == (passes.track.length, None)
