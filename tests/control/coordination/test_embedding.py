"""Where a shape stands and who takes which place: the assignment is the best one, everything lies inside."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from msrr_control.coordination.dispatcher import Knowledge
from msrr_control.coordination.embedding import assign, embeddings, place_costs
from msrr_control.coordination.shape import build_pattern
from msrr_scenes.geometry.se2 import SE2

Starts = Callable[[int, int], dict[str, SE2]]


@pytest.mark.parametrize("count", range(1, 6))
def test_no_other_assignment_is_cheaper(count: int, knowledge: Knowledge, starts: Starts) -> None:
    """Against all of them, also with more units than places."""
    body = knowledge.lanes.body
    for seed in range(10):
        units = np.array([X.as_array() for X in starts(seed, 5).values()])
        poses = build_pattern("zigzag", 6).poses(SE2(0.5, 0.2, 0.1 * seed), body)
        places = np.array([X.as_array() for X in list(poses.values())[:count]])
        costs = place_costs(units, places, knowledge.travel)
        pairs, total = assign(costs)
        best = min(
            sum(costs[u, p] for p, u in enumerate(chosen))
            for chosen in itertools.permutations(range(5), count)
        )
        assert total == pytest.approx(best, abs=1e-9)
        assert len({u for u, _ in pairs}) == len({p for _, p in pairs}) == count


def test_all_places_and_lanes_lie_inside_and_the_best_comes_first(
    knowledge: Knowledge, starts: Starts
) -> None:
    lanes, box = knowledge.lanes, knowledge.finder.box
    shape = build_pattern("comb", 7)
    units = starts(3, 8)
    keep_out = [(0.6, 0.3, 0.2)]
    found = embeddings(shape, units, lanes, box, knowledge.travel, keep_out=keep_out)
    assert len(found) == 6
    scores = [one.score for one in found]
    assert scores == sorted(scores)
    for one in found:
        assert sorted(one.units) == sorted(shape.by_name)
        assert len(set(one.units.values())) == len(shape.places)
        poses = shape.poses(one.X_WR, lanes.body)
        for place in shape.places:
            ends = [poses[place.name]] + ([lanes.end(poses[place.name])] if place.parent else [])
            for X in ends:
                assert box[0] < X.x < box[1]
                assert box[2] < X.y < box[3]
                assert math.hypot(X.x - 0.6, X.y - 0.3) > 0.2 + lanes.body.half_width


def test_a_shape_that_is_too_large_has_no_place(knowledge: Knowledge, starts: Starts) -> None:
    small = (-1.1, 1.1, -0.8, 0.8)
    assert embeddings(build_pattern("cross", 8), starts(0, 8), knowledge.lanes, small, knowledge.travel) == []


def test_named_places_are_taken_by_those_who_are_named(knowledge: Knowledge, starts: Starts) -> None:
    shape, units = build_pattern("line", 4), starts(1, 4)
    renamed = dict(zip(shape.by_name, units.values(), strict=True))
    found = embeddings(shape, renamed, knowledge.lanes, knowledge.finder.box, knowledge.travel, named=True)
    assert found
    assert all(one.units == {name: name for name in shape.by_name} for one in found)


def test_turning_the_arena_turns_the_result(knowledge: Knowledge, starts: Starts) -> None:
    """Half a turn maps the grid, the headings and the box onto themselves, so nothing else may change."""
    shape, units = build_pattern("tee", 6), starts(4, 6)
    half = SE2(0.0, 0.0, math.pi)
    turned = {name: half @ X for name, X in units.items()}
    arguments = (knowledge.lanes, knowledge.finder.box, knowledge.travel)
    first = embeddings(shape, units, *arguments, count=1)[0]
    second = embeddings(shape, turned, *arguments, count=1)[0]
    assert second.score == pytest.approx(first.score, abs=1e-6)
