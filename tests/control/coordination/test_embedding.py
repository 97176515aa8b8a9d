"""Where a shape stands and who takes which place: the assignment is the best one, everything lies inside."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from msrr_control.coordination.embedding import assign, embedding, place_costs
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.shape import build_pattern
from msrr_scenes.geometry.se2 import SE2

Starts = Callable[[int, int], dict[str, SE2]]


@pytest.mark.parametrize("count", range(1, 6))
def test_no_other_assignment_is_cheaper(count: int, setup: CoordinationSetup, starts: Starts) -> None:
    """Against all of them, also with more units than places."""
    body = setup.lanes.body
    for seed in range(10):
        units = np.array([X.as_array() for X in starts(seed, 5).values()])
        poses = build_pattern("zigzag", 6).poses(SE2(0.5, 0.2, 0.1 * seed), body)
        places = np.array([X.as_array() for X in list(poses.values())[:count]])
        costs = place_costs(units, places, setup.travel)
        pairs, total = assign(costs)
        best = min(
            sum(costs[u, p] for p, u in enumerate(chosen))
            for chosen in itertools.permutations(range(5), count)
        )
        assert total == pytest.approx(best, abs=1e-9)
        assert len({u for u, _ in pairs}) == len({p for _, p in pairs}) == count


def test_all_places_and_lanes_lie_inside(setup: CoordinationSetup, starts: Starts) -> None:
    lanes, box = setup.lanes, setup.finder.box
    shape = build_pattern("comb", 7)
    units = starts(3, 8)
    keep_out = [(0.6, 0.3, 0.2)]
    found = embedding(shape, units, lanes, box, setup.travel, keep_out=keep_out)
    assert found is not None
    assert sorted(found.units) == sorted(shape.by_name)
    assert len(set(found.units.values())) == len(shape.places)
    poses = shape.poses(found.X_WR, lanes.body)
    for place in shape.places:
        ends = [poses[place.name]] + ([lanes.end(poses[place.name])] if place.parent else [])
        for X in ends:
            assert box[0] < X.x < box[1]
            assert box[2] < X.y < box[3]
            assert math.hypot(X.x - 0.6, X.y - 0.3) > 0.2 + lanes.body.half_width


def test_a_shape_that_follows_fits_with_room_to_spare(setup: CoordinationSetup, starts: Starts) -> None:
    """A cross of four just fits into the arena: a line was built where there was no room to spare for it.

    Its root came to rest a centimetre off, and the cross did not fit any more: two of three trials ended so.
    """
    lanes, box, spare = setup.lanes, setup.finder.box, 0.1
    line, cross = build_pattern("line", 4), build_pattern("cross", 4)
    for seed in range(10):
        found = embedding(line, starts(seed, 4), lanes, box, setup.travel, later=[cross])
        assert found is not None
        poses = cross.poses(found.X_WR, lanes.body)
        for X in (lanes.end(poses[place.name]) for place in cross.places[1:]):
            room = lanes.spec.border_m + lanes.body.offset + spare
            assert box[0] + room < X.x < box[1] - room
            assert box[2] + room < X.y < box[3] - room


def test_that_the_last_shape_fits_comes_before_room_to_spare_for_the_one_before(
    setup: CoordinationSetup, starts: Starts
) -> None:
    """Where the tee had room to spare, there was none for the cross, and two shapes were built in vain."""
    lanes, box = setup.lanes, (-2.8, 2.8, -1.35, 1.35)
    posts = [(1.17, 0.053, 0.086), (0.896, -0.407, 0.079), (1.377, 0.978, 0.08)]
    zigzag, *later = (build_pattern(name, 8) for name in ("zigzag", "tee", "cross"))
    found = embedding(zigzag, starts(0, 8), lanes, box, setup.travel, keep_out=posts, later=later)
    assert found is not None
    room = lanes.spec.border_m + lanes.body.offset - 1e-6
    for shape in (zigzag, *later):
        poses = shape.poses(found.X_WR, lanes.body)
        for X in (lanes.end(poses[place.name]) for place in shape.places[1:]):
            assert box[0] + room < X.x < box[1] - room
            assert box[2] + room < X.y < box[3] - room


def test_where_the_best_place_is_taken_no_other_one_is_better(
    setup: CoordinationSetup, starts: Starts
) -> None:
    shape, units = build_pattern("comb", 7), starts(3, 8)
    scores, keep_out = [], []
    for _ in range(4):
        arena = setup.lanes, setup.finder.box, setup.travel
        found = embedding(shape, units, *arena, keep_out=keep_out)
        assert found is not None
        scores.append(found.score)
        keep_out.append((found.X_WR.x, found.X_WR.y, 0.05))
    assert scores == sorted(scores)
    assert scores[0] < scores[-1]


def test_a_shape_that_is_too_large_has_no_place(setup: CoordinationSetup, starts: Starts) -> None:
    small = (-1.1, 1.1, -0.8, 0.8)
    cross = build_pattern("cross", 8)
    assert embedding(cross, starts(0, 8), setup.lanes, small, setup.travel) is None


def test_named_places_are_taken_by_those_who_are_named(setup: CoordinationSetup, starts: Starts) -> None:
    shape, units = build_pattern("line", 4), starts(1, 4)
    renamed = dict(zip(shape.by_name, units.values(), strict=True))
    found = embedding(shape, renamed, setup.lanes, setup.finder.box, setup.travel, named=True)
    assert found is not None
    assert found.units == {name: name for name in shape.by_name}


def test_turning_the_arena_turns_the_result(setup: CoordinationSetup, starts: Starts) -> None:
    """Half a turn maps the grid, the headings and the box onto themselves, so nothing else may change."""
    shape, units = build_pattern("tee", 6), starts(4, 6)
    half = SE2(0.0, 0.0, math.pi)
    turned = {name: half @ X for name, X in units.items()}
    arguments = (setup.lanes, setup.finder.box, setup.travel)
    first, second = embedding(shape, units, *arguments), embedding(shape, turned, *arguments)
    assert first is not None
    assert second is not None
    assert second.score == pytest.approx(first.score, abs=1e-6)
