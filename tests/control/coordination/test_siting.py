"""Where a shape is built: by those who may take part, clear of others, elsewhere while nobody has docked."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from msrr_control.coordination.embedding import embedding
from msrr_control.coordination.ledger import UnitRecord
from msrr_control.coordination.mission import Mission
from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.coordination.siting import Siting, check_shapes
from msrr_control.shapes.shape import Shape, build_pattern
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate
from msrr_scenes.messages.coordination import UnitState
from msrr_scenes.specs.plan import MoveStep
from msrr_scenes.specs.spec import PoseSpec

Starts = Callable[..., dict[str, SE2]]

TREE = Shape.from_tree({"a": "root", "b": "a.rear", "c": "b.rear", "d": "a.left"})


def _records(starts: dict[str, SE2]) -> dict[str, UnitRecord]:
    return {name: UnitRecord(name, X) for name, X in starts.items()}


def test_a_shape_is_placed_clear_of_obstacles_and_of_those_who_take_no_part(
    setup: CoordinationSetup, starts: Starts
) -> None:
    """Without them it would be placed where they are."""
    mission, radius = Mission(shape=build_pattern("line", 3)), setup.lanes.body.radius
    units = _records(starts(2, 4))
    tasks, chosen = Siting(mission, setup).choose(units.values(), ())
    root = tasks[0].pose
    assert root is not None
    assert len(chosen) == len(tasks) == 3
    there = {name: unit.pose for name, unit in units.items()}
    best = embedding(build_pattern("line", 3), there, setup.lanes, setup.finder.box, setup.travel)
    assert best is not None
    assert root == best.X_WR, "those who may take part can drive away"
    out, post = units["u3"], ObstacleEstimate("post", 0, root, np.eye(3), 0.08)
    cases = (UnitState.IDLE, out.pose, (post,)), (UnitState.FAILED, root, ())
    for out.state, out.X_WU, obstacles in cases:
        tasks, chosen = Siting(mission, setup).choose(units.values(), obstacles)
        moved = tasks[0].pose
        assert moved is not None
        assert math.hypot(moved.x - root.x, moved.y - root.y) > radius
        assert out.state is UnitState.IDLE or "u3" not in chosen.values()


def test_of_a_shape_with_named_places_all_is_built_for_which_units_are_there(
    setup: CoordinationSetup, starts: Starts
) -> None:
    """A place without its parent is left out as well, and all tasks are told."""
    mission = Mission(shape=TREE, named=True)
    units = {name: UnitRecord(name, X) for name, X in zip("abcd", starts(1, 4).values(), strict=True)}
    for missing, built in (("", "abcd"), ("b", "ad"), ("c", "abd"), ("d", "abc")):
        there = [unit for name, unit in units.items() if name != missing]
        tasks, chosen = Siting(mission, setup).choose(there, ())
        assert chosen == {name: name for name in built}
        assert {task.name for task in tasks} == set("abcd")
    with pytest.raises(SceneError, match="no unit is there for the root"):
        Siting(mission, setup).choose([units["b"], units["c"]], ())


def test_an_unnamed_shape_is_begun_by_those_who_are_there(setup: CoordinationSetup, starts: Starts) -> None:
    mission = Mission(shape=TREE)
    tasks, chosen = Siting(mission, setup).choose(_records(starts(1, 2)).values(), ())
    assert set(chosen) == {task.name for task in tasks[:2]}
    unseen = [UnitRecord("u0"), UnitRecord("u1", SE2(), state=UnitState.LOST)]
    with pytest.raises(SceneError, match="no unit is there for the root"):
        Siting(mission, setup).choose(unseen, ())


def test_the_root_of_an_assembly_has_to_be_seen_and_to_take_part(setup: CoordinationSetup) -> None:
    mission = Mission(shape=Shape.from_tree({"a": "root", "b": "a.left"}), holders={"b": "a.rear"})
    a, b = UnitRecord("a", SE2()), UnitRecord("b", SE2(-0.2), holder=("a", "rear"))
    tasks, chosen = Siting(mission, setup).choose([a, b], ())
    assert [task.name for task in tasks] == ["b to a.left"]
    assert chosen == {}
    for a.X_WU, a.state in ((None, UnitState.IDLE), (SE2(), UnitState.FAILED)):
        with pytest.raises(SceneError, match="the root 'a' of the assembly is not seen"):
            Siting(mission, setup).choose([a, b], ())


def test_names_are_known_only_of_a_shape_that_was_built_of_named_places(setup: CoordinationSetup) -> None:
    """Anybody may have taken the place of the root, which stays where it is."""
    line = Shape.from_tree({"a": "root", "b": "a.rear"})
    left = Mission(shape=Shape.from_tree({"a": "root", "b": "a.left"}), named=True)
    check_shapes(Mission(shape=line, named=True, then=left), setup.lanes)
    check_shapes(Mission(shape=line, holders={"b": "a.left"}, then=left), setup.lanes)
    with pytest.raises(SceneError, match="name the places of that shape, too"):
        check_shapes(Mission(shape=line, then=left), setup.lanes)
    right = Mission(shape=Shape.from_tree({"a": "root", "c": "a.right"}), named=True)
    with pytest.raises(SceneError, match="the places c are named by no unit"):
        check_shapes(Mission(shape=line, named=True, then=right), setup.lanes)


def test_a_shape_may_be_built_elsewhere_while_nobody_moves_or_has_docked(setup: CoordinationSetup) -> None:
    siting, units = Siting(Mission(shape=TREE), setup), [UnitRecord("a", SE2()), UnitRecord("b", SE2(1.0))]
    assert siting.may_move(units)
    units[1].state = UnitState.UNDER_WAY
    assert not siting.may_move(units)
    units[1].state, units[1].holder = UnitState.DOCKED, ("a", "rear")
    assert not siting.may_move(units)
    units[1].state, units[1].holder = UnitState.IDLE, None
    for k in range(3):
        assert siting.may_move(units)
        siting.chosen = True
        siting.move()
        assert (siting.chosen, siting.moves) == (False, k + 1)
    assert not siting.may_move(units)
    step = MoveStep(move="a", pose=PoseSpec(x_m=0.5))
    line = Shape.from_tree({"a": "root", "b": "a.rear"})
    for mission in (Mission(steps=[step]), Mission(shape=line, holders={"b": "a.rear"})):
        assert not Siting(mission, setup).may_move(units)


def test_any_unit_that_is_seen_can_be_the_root_but_of_named_places_and_of_assemblies(
    setup: CoordinationSetup,
) -> None:
    """A plan has no root, and is chosen before anybody is seen."""
    units = {"a": UnitRecord("a"), "b": UnitRecord("b")}
    missions = Mission(), Mission(TREE), Mission(TREE, named=True), Mission(TREE, holders={"b": "a.rear"})
    found = []
    for seen in ("", "b", "a"):
        if seen:
            units[seen].X_WU = SE2()
        found.append([Siting(mission, setup).sees_root(units.values()) for mission in missions])
    assert found == [
        [True, False, False, False],
        [True, True, False, False],
        [True, True, True, True],
    ]
