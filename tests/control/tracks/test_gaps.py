"""Gaps: two units that obey `needed` never meet, and what a track comes too near to is told."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.path_following.path import Path
from msrr_control.tracks.gaps import GAP_M, LANE_GAP_M, PORT_GAP_M, first_contact, first_near, needed
from msrr_control.tracks.route_request import RouteRequest, Standing
from msrr_control.tracks.track import SPACING_M, TrackBuilder
from msrr_scenes.geometry.se2 import SE2

OFFSET = 0.1


def test_two_units_that_obey_never_come_too_near(setup: CoordinationSetup) -> None:
    """Law: wherever both may be at once, and wherever the earlier one still goes, their bodies are apart."""
    rng, finder, body = np.random.default_rng(5), setup.finder, setup.lanes.body
    crossed = 0
    for _ in range(12):
        starts = [SE2(*rng.uniform([-1.6, -1.1, -3.0], [1.6, 1.1, 3.0])) for _ in range(2)]
        ends = [SE2(*rng.uniform([-1.4, -0.9, -3.0], [1.4, 0.9, 3.0])) for _ in range(2)]
        others = [Standing("other", starts[1], False)], [Standing("first", ends[0], False)]
        if math.hypot(starts[0].x - starts[1].x, starts[0].y - starts[1].y) < 0.4:
            continue
        tracks = [finder.find(RouteRequest(starts[k], ends[k], others[k])) for k in range(2)]
        if tracks[0] is None or tracks[1] is None:
            continue
        earlier, later = tracks[0], tracks[1]
        until = needed(earlier, later, body)
        assert (np.diff(np.nan_to_num(until, neginf=-9.0)) >= 0.0).all()
        crossed += bool((until > 0.0).any())
        for s in (*rng.uniform(0.0, earlier.length, 12), *earlier.s[1::7], earlier.length):
            allowed = until <= s
            ahead = earlier.poses[earlier.s >= s]
            assert not body.near(ahead[:, None], later.poses[allowed][None], GAP_M).any()
            # Just as needed, no more: the first sample that is not allowed would come too near.
            if not allowed.all():
                behind = earlier.poses[np.searchsorted(earlier.s, s) - 1 :]
                refused = later.poses[: int(allowed.sum()) + 1][-1:]
                assert body.near(behind[:, None], refused[None], GAP_M).any()
    assert crossed >= 3


def test_a_body_on_a_track_is_found_where_it_stands(setup: CoordinationSetup) -> None:
    builder = TrackBuilder(SE2(-1.0, 0.0, 0.0), OFFSET)
    builder.follow(Path(np.array([-1.0, 0.0, 0.0]), np.zeros(1), np.array([2.0])))
    track, body = builder.track(), setup.lanes.body
    near = SE2(0.5, 0.1, 0.3)
    found = first_near(track, near, False, body)
    assert found is not None
    assert body.gap(track.at(found), near) < GAP_M
    assert body.gap(track.at(found - 2.0 * SPACING_M), near) >= GAP_M > PORT_GAP_M
    assert first_near(track, SE2(0.0, 1.0), False, body) is None


@pytest.mark.parametrize("extra", [0.0, 0.03])
def test_the_gap_that_is_kept_is_that_of_where_both_are(setup: CoordinationSetup, extra: float) -> None:
    """It is widest in a dock leg, least between two at ports; bodies known less well stay farther apart."""
    body = replace(setup.lanes.body, extra_gap=extra)
    lane, drive = TrackBuilder(SE2(), OFFSET), TrackBuilder(SE2(), OFFSET)
    lane.dock(SE2(0.7, 0.0, 0.0), 0.7)
    drive.ahead(0.7)
    for track, at_port, gap in (
        (drive.track(), False, GAP_M + extra),
        (lane.track(), False, LANE_GAP_M + extra),
        (lane.track(), True, PORT_GAP_M),
    ):
        for off, meets in ((-0.002, True), (0.002, False)):
            beside = SE2(0.7, 2.0 * body.half_width + gap + off, 0.0)
            assert (first_near(track, beside, at_port, body) is not None) is meets


def test_of_all_that_a_track_meets_the_first_is_told(setup: CoordinationSetup) -> None:
    builder = TrackBuilder(SE2(-1.0, 0.0, 0.0), setup.lanes.body.offset)
    builder.ahead(1.6)
    near, far = Standing("z", SE2(-0.2, 0.1, 0.3), False), Standing("a", SE2(0.4, -0.1, 0.3), False)
    for both in ((near, far), (far, near)):
        contact = first_contact(builder.track(), both, setup.lanes.body)
        assert contact is not None
        assert contact[1] == "z"
