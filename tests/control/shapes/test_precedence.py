"""Lanes of ports, and the order in which tasks leave them open: one rule at a time."""

from __future__ import annotations

from dataclasses import dataclass, field
from graphlib import CycleError

import numpy as np
import pytest

from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.precedence import Stay, precede, topological_order
from msrr_control.shapes.shape import LEAST_GAP_M
from msrr_scenes.geometry.se2 import SE2


def test_a_lane_is_as_wide_as_a_unit_that_docks_and_before_that_as_its_routes(
    setup: CoordinationSetup,
) -> None:
    lanes, rng = setup.lanes, np.random.default_rng(0)
    body, spec = lanes.body, lanes.spec
    begin, shortest = body.offset - spec.handover_m, min(spec.lead_in_m)
    room = body.radius + body.half_width + spec.unit_margin_m
    beside = 2.0 * body.half_width + LEAST_GAP_M
    for off, closes in ((-0.003, True), (0.003, False)):
        for x, y in (
            (-0.35, beside + off),
            (-0.35, -beside - off),
            (begin - shortest * 4 / 7, room + off),
            (begin - shortest * 4 / 7, -room - off),
            (begin - shortest - room - off, 0.0),
        ):
            X_WU = SE2(*rng.uniform(-3.0, 3.0, 3))
            assert lanes.closed_by(X_WU, X_WU @ SE2(x, y, 0.0)) is closes
    X_WU = SE2(0.4, -0.2, 1.0)
    before = (lanes.end(X_WU).inverse() @ X_WU).as_array()
    assert before == pytest.approx([spec.handover_m + shortest + 0.2, 0.0, 0.0])


@dataclass
class Case:
    """Who stands in the lane of a docking ``a``, what holds before, and what has to come of it."""

    other: Stay
    adds: dict[str, list[str]] = field(default_factory=dict)
    conflict: bool = False
    holds: dict[str, list[str]] = field(default_factory=dict)


PLACE, IN_LANE, ASIDE = SE2(), SE2(-0.35, 0.0, 0.0), SE2(-0.35, 2.0, 0.0)
CASES = {
    "comes later": Case(Stay("b", "", IN_LANE, "b"), {"b": ["a"]}),
    "leaves before": Case(Stay("b", "", IN_LANE, None, "b"), {"a": ["b"]}),
    "stays": Case(Stay("b", "", IN_LANE), conflict=True),
    "makes way": Case(Stay("b", "", IN_LANE, may_make_way=True)),
    "has come before and stays": Case(Stay("b", "", IN_LANE, "b"), conflict=True, holds={"a": ["b"]}),
    "has come before and leaves": Case(Stay("b", "", IN_LANE, "b", "c"), {"a": ["c"]}, holds={"a": ["b"]}),
    "leaves only after": Case(
        Stay("b", "", IN_LANE, None, "c"), conflict=True, holds={"c": ["b"], "b": ["a"]}
    ),
    "stands aside": Case(Stay("b", "", ASIDE)),
    "is in another frame": Case(Stay("b", "other", IN_LANE)),
    "is in the port itself": Case(Stay("b", "", PLACE, port="r.rear")),
    "holds the port": Case(Stay("r", "", IN_LANE)),
}


@pytest.mark.parametrize("name", CASES)
def test_who_docks_comes_before_who_would_stand_in_its_lane(name: str, setup: CoordinationSetup) -> None:
    case = CASES[name]
    before = {task: list(case.holds.get(task, ())) for task in "abc"}
    conflicts = precede(before, [Stay("u", "", PLACE, "a", port="r.rear"), case.other], setup.lanes)
    assert before == {task: case.holds.get(task, []) + case.adds.get(task, []) for task in "abc"}
    assert conflicts == ([(case.other, "a")] if case.conflict else [])


@pytest.mark.parametrize("name", CASES)
def test_who_leaves_a_port_needs_its_lane_as_well(name: str, setup: CoordinationSetup) -> None:
    """But it need not be refused: it waits until somebody has gone."""
    case = CASES[name]
    before = {task: list(case.holds.get(task, ())) for task in "abc"}
    stays = [case.other, Stay("u", "", PLACE, None, "a", port="r.rear")]
    assert precede(before, stays, setup.lanes) == []
    assert before == {task: case.holds.get(task, []) + case.adds.get(task, []) for task in "abc"}


def test_the_order_is_the_given_one_as_far_as_what_comes_before_allows() -> None:
    before: dict[str, list[str]] = {"c": ["b"], "a": [], "b": [], "d": ["a"]}
    assert topological_order(before, before) == ["a", "b", "c", "d"]
    assert topological_order("dcba", before) == ["b", "c", "a", "d"]
    with pytest.raises(CycleError):
        topological_order(before, {**before, "b": ["c"]})
