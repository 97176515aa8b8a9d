"""Places where units wait: all points of the grid that are far enough from what is in use, and no others."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.waiting_places import WAITING_ROOM_M, waiting_places
from msrr_control.tracks.gaps import GAP_M
from msrr_control.tracks.track import TrackBuilder
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import UnitState


def _distance(points: np.ndarray, taken: list[SE2]) -> np.ndarray:
    """Distance of each point from the nearest place [m]."""
    return np.min([np.hypot(points[:, 0] - X.x, points[:, 1] - X.y) for X in taken], axis=0)


@pytest.mark.parametrize("state", [UnitState.UNDER_WAY, UnitState.IDLE])
def test_a_unit_waits_where_it_is_in_nobodys_way(setup: CoordinationSetup, state: UnitState) -> None:
    """Of a route that is over only the unit itself is in the way."""
    lanes, box = setup.lanes, setup.finder.box
    docked, body = SE2(0.6, 0.3, 0.4), setup.lanes.body
    builder = TrackBuilder(SE2(-1.5, -1.0, 0.3), body.offset)
    builder.ahead(1.2)
    drives, track = SE2(-1.5, -1.0, 0.3), builder.track()
    others = [UnitRecord("a", drives, state=state, track=track), UnitRecord("b", SE2(1.5, -0.8))]
    post = ObstacleEstimate("post", 0, SE2(-1.0, 0.8), np.eye(3), 0.05)
    heap = ObstacleEstimate("heap", 0, SE2(1.5, 1.0), np.eye(3), 0.5)
    free = waiting_places(lanes, box, [docked], others, [post, heap])
    everywhere = waiting_places(lanes, box, [], [], [])
    taken = [docked @ SE2(-way, 0.0, 0.0) for way in np.linspace(0.0, lanes.length, 8)]
    taken += [drives, SE2(1.5, -0.8), post.X_WB]
    if state is UnitState.UNDER_WAY:
        taken += [SE2(*pose) for pose in track.poses]
    apart = _distance(everywhere, taken)
    apart = np.minimum(apart, _distance(everywhere, [heap.X_WB]) - (0.5 - body.radius))
    np.testing.assert_array_equal(free, everywhere[apart > WAITING_ROOM_M])
    assert 10 < len(free) < len(everywhere) - 10
    assert 2.0 * body.radius + GAP_M < WAITING_ROOM_M


def test_waiting_places_cover_the_box_but_for_its_border(setup: CoordinationSetup) -> None:
    """A unit turns on its place: its controlled point keeps the distance from the border of any route."""
    x0, x1, y0, y1 = setup.finder.box
    places = waiting_places(setup.lanes, setup.finder.box, [], [], [])
    edge = setup.finder.spec.border_m + setup.lanes.body.offset
    assert places.min(axis=0) == pytest.approx([x0 + edge, y0 + edge])
    assert (places <= [x1 - edge + 1e-6, y1 - edge + 1e-6]).all()
    rng = np.random.default_rng(0)
    for x, y in rng.uniform([x0 + edge, y0 + edge], [x1 - edge, y1 - edge], (200, 2)).tolist():
        assert _distance(places, [SE2(x, y)]).min() < 0.25 * math.sqrt(2.0)
