"""Shapes: patterns and trees, the poses of their places, and what cannot be built."""

from __future__ import annotations

import math
from typing import get_args

import numpy as np
import pytest

from msrr_control.coordination.setup import CoordinationSetup
from msrr_control.shapes.shape import Shape, build_pattern
from msrr_control.shapes.tasks import shape_tasks
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.specs.mission import Pattern, ShapeSpec

PATTERNS: tuple[Pattern, ...] = get_args(Pattern)


def random_tree(rng: np.random.Generator, count: int) -> dict[str, str]:
    """A tree of ports, most of which cannot be built."""
    tree = {"p0": "root"}
    while len(tree) < count:
        parent, port = f"p{rng.integers(len(tree))}", ("rear", "left", "right")[rng.integers(3)]
        if f"{parent}.{port}" not in tree.values():
            tree[f"p{len(tree)}"] = f"{parent}.{port}"
    return tree


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("count", range(4, 17))
def test_every_pattern_can_be_built_with_any_number_of_units(
    pattern: Pattern, count: int, setup: CoordinationSetup
) -> None:
    shape = Shape.of(ShapeSpec.model_validate({pattern: count}))
    assert len(shape.places) == count
    assert len(shape.by_name) == count
    order = [task.name for task in shape_tasks(shape, setup.lanes)]
    assert sorted(order) == sorted(shape.by_name)


def test_the_front_of_a_docked_unit_meets_the_port_face_to_face(setup: CoordinationSetup) -> None:
    body = setup.lanes.body
    X_WR = SE2(0.3, -0.2, 0.7)
    shape = build_pattern("cross", 8)
    poses = shape.poses(X_WR, body)
    for place in shape.places[1:]:
        assert place.parent is not None
        X_WD = poses[place.parent] @ body.dock_frames[place.port]
        X_WF = poses[place.name] @ SE2(body.offset, 0.0, 0.0)
        X = X_WD.inverse() @ X_WF
        assert math.hypot(X.x, X.y) < 1e-9
        assert abs(X.yaw) < 1e-9


def test_the_form_of_a_shape_does_not_depend_on_where_it_stands(setup: CoordinationSetup) -> None:
    body, shape = setup.lanes.body, build_pattern("zigzag", 7)
    X = SE2(-1.0, 0.4, 2.0)
    here, there = shape.poses(SE2(), body), shape.poses(X, body)
    for name in here:
        moved = X @ here[name]
        np.testing.assert_allclose(moved.as_array(), there[name].as_array(), atol=1e-9)


@pytest.mark.parametrize(
    ("tree", "reason"),
    [
        ({"a": "root", "b": "a.front"}, "active port"),
        ({"a": "root", "b": "a.roof"}, "takes nobody"),
        ({"a": "root", "b": "a.rear", "c": "a.rear"}, "taken by b"),
        ({"a": "root", "b": "a.left", "c": "b.left", "d": "c.left"}, "a and d would touch"),
        (
            # Two units side by side: the second column docks beside the first, with no port between.
            {"a": "root", "b": "a.rear", "c": "b.rear", "d": "c.left", "e": "d.left"},
            "side by side",
        ),
        (
            # A spiral: the last unit would have to come through the root.
            {
                "root": "root",
                "a": "root.left",
                "b": "a.rear",
                "c": "b.right",
                "d": "c.rear",
                "e": "d.rear",
                "f": "e.right",
                "g": "f.rear",
                "h": "g.right",
            },
            "has to be built before h and closes its lane",
        ),
    ],
)
def test_what_cannot_be_built_is_refused_with_its_reason(
    tree: dict[str, str], reason: str, setup: CoordinationSetup
) -> None:
    with pytest.raises(SceneError, match=reason):
        shape_tasks(Shape.from_tree(tree), setup.lanes)


@pytest.mark.parametrize(
    ("tree", "reason"),
    [
        ({"a": "b.rear", "b": "a.rear"}, "exactly one root, found none"),
        ({"a": "root", "b": "root"}, "exactly one root, found a, b"),
        ({"a": "root", "b": "x.rear"}, "b: no place named 'x'"),
    ],
)
def test_what_is_no_tree_is_refused(tree: dict[str, str], reason: str) -> None:
    with pytest.raises(SceneError, match=reason):
        Shape.from_tree(tree)


def test_in_the_order_of_precedence_every_parent_stands_and_every_lane_is_open(
    setup: CoordinationSetup,
) -> None:
    """The law that precedence stands for, checked place by place on random trees as they are built."""
    rng = np.random.default_rng(7)
    built = 0
    for _ in range(60):
        shape = Shape.from_tree(random_tree(rng, int(rng.integers(3, 9))))
        try:
            before = {task.name: task.behind for task in shape_tasks(shape, setup.lanes)}
        except SceneError:
            continue
        built += 1
        poses = shape.poses(SE2(), setup.lanes.body)
        standing: list[str] = []
        for name in before:
            place = shape.by_name[name]
            assert place.parent is None or place.parent in standing
            assert set(before[name]) <= set(standing)
            others = [other for other in standing if other != place.parent]
            if place.parent is not None:
                assert not any(setup.lanes.closed_by(poses[name], poses[other]) for other in others)
            standing.append(name)
    assert built >= 5


def test_a_scene_names_exactly_one_form() -> None:
    for wrong in ({}, {"line": 3, "tee": 4}, {"line": 3, "named": True}, {"line": 0}):
        with pytest.raises(ValueError, match=r"exactly one|named needs|greater than"):
            ShapeSpec.model_validate(wrong)
