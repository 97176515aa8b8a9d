"""From one form to another by leaves: every hop can be made, and no fewer would do."""

from __future__ import annotations

import itertools
import math
from typing import get_args

import pytest

from msrr_control.coordination.knowledge import Knowledge
from msrr_control.coordination.reconfiguration import (
    Ports,
    Reconfiguration,
    assembly_ports,
    reconfiguration_tasks,
    shape_ports,
)
from msrr_control.coordination.shape import Shape, build_pattern
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.mission import Pattern

WIDE = (-9.0, 9.0, -9.0, 9.0)
PAIRS = list(itertools.permutations(get_args(Pattern), 2))


def _form(shape: Shape) -> dict[Ports, str]:
    return dict.fromkeys(shape_ports(shape).values(), "")


def _least(start: set[Ports], goal: set[Ports]) -> int:
    """No way has fewer hops than there are places to fill."""
    return len(goal - start)


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_every_hop_can_be_made_and_the_last_one_ends_in_the_shape(
    first: Pattern, second: Pattern, knowledge: Knowledge
) -> None:
    start, goal = _form(build_pattern(first, 5)), _form(build_pattern(second, 5))
    hops = Reconfiguration(knowledge.lanes, SE2(), WIDE).hops(start, goal)
    body, taken = knowledge.lanes.body, set(start)
    for leaves, enters in hops:
        assert leaves in taken
        assert not any(place[:-1] == leaves for place in taken if place), "somebody is in its port"
        taken.remove(leaves)
        assert enters not in taken
        assert enters[:-1] in taken
        taken.add(enters)
        shape = Shape.from_tree(
            {
                "/".join(("r", *place)): "/".join(("r", *place[:-1])) + "." + place[-1] if place else "root"
                for place in sorted(taken)
            }
        )
        assert shape.problem(body) is None
    assert taken == set(goal)
    assert len(hops) >= _least(set(start), set(goal))


def test_the_largest_common_part_stays_where_leaves_allow_it(knowledge: Knowledge) -> None:
    for first, second, hops in (("line", "tee", 2), ("cross", "line", 3), ("comb", "tee", 1)):
        start, goal = _form(build_pattern(first, 6)), _form(build_pattern(second, 6))
        found = Reconfiguration(knowledge.lanes, SE2(), WIDE).hops(start, goal)
        assert len(found) == _least(set(start), set(goal)) == hops


def test_the_search_is_quick_where_units_have_to_step_aside(knowledge: Knowledge) -> None:
    """Of the patterns of 8 units these need the most hops more than there are places to fill."""
    start, goal = _form(build_pattern("line", 8)), _form(build_pattern("zigzag", 8))
    hops = Reconfiguration(knowledge.lanes, SE2(), WIDE).hops(start, goal)
    assert len(hops) > _least(set(start), set(goal))


def test_there_and_back_takes_the_same_number_of_hops(knowledge: Knowledge) -> None:
    """Every hop can be made backwards, so the fewest of one way are the fewest of the other."""
    for first, second in itertools.combinations(get_args(Pattern), 2):
        start, goal = _form(build_pattern(first, 5)), _form(build_pattern(second, 5))
        search = Reconfiguration(knowledge.lanes, SE2(), WIDE)
        assert len(search.hops(start, goal)) == len(search.hops(goal, start))


def test_an_assembly_is_one_tree() -> None:
    assert assembly_ports({"b": "a.rear", "c": "b.left"}) == {"a": (), "b": ("rear",), "c": ("rear", "left")}
    with pytest.raises(SceneError, match="exactly one root, found b, d"):
        assembly_ports({"a": "b.rear", "c": "d.rear"})


def test_named_units_end_where_they_are_named(knowledge: Knowledge) -> None:
    holders = {"b": "a.rear", "c": "b.rear", "d": "c.rear"}
    shape = Shape.from_tree({"a": "root", "b": "a.rear", "d": "b.rear", "c": "b.left"})
    tasks = reconfiguration_tasks(holders, shape, knowledge.lanes, SE2(), WIDE, named=True)
    now = dict(holders)
    task_units = {task.name: task.unit for task in tasks}
    for task in tasks:
        assert task.unit is not None
        holder = task.parent_unit if task.parent is None else task_units[task.parent]
        now[task.unit] = f"{holder}.{task.port}"
    assert now == {"b": "a.rear", "d": "b.rear", "c": "b.left"}


@pytest.mark.parametrize("pattern", ["line", "tee", "comb"])
def test_the_tasks_of_all_hops_lead_to_the_shape(pattern: Pattern, knowledge: Knowledge) -> None:
    """From a zigzag in a corner, where units come to a port twice on their way: both tasks had one name."""
    X_WR = SE2(-0.16, -0.91, math.radians(-45.0))
    places, goal = shape_ports(build_pattern("zigzag", 6)), build_pattern(pattern, 6)
    name_of = {ports: name for name, ports in places.items()}
    joints = {name: f"{name_of[ports[:-1]]}.{ports[-1]}" for name, ports in places.items() if ports}
    tasks = reconfiguration_tasks(joints, goal, knowledge.lanes, X_WR, knowledge.finder.box)
    unit_of = {task.name: task.unit for task in tasks}
    assert len(unit_of) == len(tasks)
    for task in tasks:
        assert task.unit is not None
        holder = task.parent_unit if task.parent is None else unit_of[task.parent]
        joints[task.unit] = f"{holder}.{task.port}"
    assert set(assembly_ports(joints).values()) == set(shape_ports(goal).values())


def test_what_cannot_be_is_refused(knowledge: Knowledge) -> None:
    holders = {"b": "a.rear", "c": "b.rear"}
    with pytest.raises(SceneError, match="3 units, the shape 4"):
        reconfiguration_tasks(holders, build_pattern("line", 4), knowledge.lanes, SE2(), WIDE)
    narrow = (-2.0, 0.4, -0.4, 0.4)
    with pytest.raises(SceneError, match="do not fit into the arena from where the root"):
        reconfiguration_tasks(holders, build_pattern("zigzag", 3), knowledge.lanes, SE2(), narrow)
