"""Scenes that begin with assembled units, and plans that undock: what cannot be is named, with the mend."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from msrr_scenes import load_scene
from msrr_scenes.errors import SceneError

SCENE = """\
arena: {x_m: [-2.2, 2.2], y_m: [-1.7, 1.7]}
units:
  a: {number: 0, pose: {x_m: 0.8, spread: {x_m: 0.2, yaw_deg: 20}}}
  b: {number: 1}
  c: {number: 2}
  d: {number: 3, pose: {x_m: -1.0, y_m: 1.0}}
cameras: {overhead: {height_m: 4.0}}
assembled: [b.front-a.rear, c.front-b.rear]
plan: [{undock: c}]
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "three.yaml"
    path.write_text(SCENE)
    return path


def test_the_scene_as_it_is_has_no_fault(scene_file: Path) -> None:
    scene = load_scene(scene_file)
    assert scene.holders == {"b": "a.rear", "c": "b.rear"}
    assert [str(dock) for dock in scene.assembled_docks] == ["b.front to a.rear", "c.front to b.rear"]


@pytest.mark.parametrize(
    ("overrides", "place", "mend"),
    [
        ({"assembled": "[b.front-x.rear]"}, "assembled.0", "no unit named 'x'"),
        ({"assembled": "[x.front-b.rear]"}, "assembled.0", "no unit named 'x'"),
        ({"assembled": "[b.front-a.raer]"}, "assembled.0", "did you mean 'rear'"),
        ({"assembled": "[b.rear-a.front]"}, "assembled.0", "'rear' of 'b' has no pins; active ports: front"),
        ({"assembled": "[b.front-a.front]"}, "assembled.0", "no holes to dock to; passive ports: "),
        ({"assembled": "[b.front-a.rear, c.front-a.rear]"}, "assembled.1", "name another port"),
        ({"assembled": "[b.front-a.rear, b.front-c.rear]"}, "assembled.1", "has one active port"),
        ({"assembled": "[b.front-a.rear, b.front-a.rear]"}, "assembled.1", "named twice"),
        ({"assembled": "[a.front-b.rear, b.front-c.rear, c.front-a.rear]"}, "assembled.0", "a ring (a to b"),
        ({"assembled": "[b.front-b.rear]"}, "assembled.0", "cannot be locked to itself"),
        ({"assembled": "[b.front]"}, "assembled.0", "expected <unit>.<port>-<unit>.<port>"),
        ({"units.b.pose.x_m": "0.3"}, "units.b.pose", "remove the pose, or move 'a'"),
        ({"units.a.pose.frame": "c.rear"}, "units.a.pose.frame", "placed relative to itself"),
        # Once around the corner: d would stand flank to flank with a.
        ({"assembled": "[b.front-a.left, c.front-b.right, d.front-c.right]", "units.d": "{number: 3}",
          "plan": "[{undock: d}]"},
         "assembled", "lock one of them elsewhere"),
        ({"units.a.pose.x_m": "-1.6"}, "units.a.pose", "'c', which is locked to it, reaches outside"),
        ({"cameras.overhead.height_m": "1.2"}, "units.a.pose", "does not see 'c' from above"),
        ({"cameras.overhead": "null"}, "cameras.overhead", "a base station leads the units by it; add one"),
        ({"units.d.pose": "{x_m: 0.2, y_m: 0.2}"}, "units.d.pose", "overlaps 'c'"),
        ({"plan": "[{undock: d}]"}, "plan.0.undock", "not docked by then"),
        ({"plan": "[{undock: b}]"}, "plan.0.undock", "let 'c' undock before"),
        ({"plan": "[{move: a, pose: {x_m: 0}}]"}, "plan.0.move", "let 'b' undock before"),
        ({"plan": "[{unit: c, to: b.rear}]"}, "plan.0.to", "is docked there by then"),
        ({"plan": "[{unit: d, to: b.rear}]"}, "plan.0.to", "'c' is docked to it by then"),
        ({"plan": "[{undock: c}, {undock: c, name: again}]"}, "plan.1.undock", "not docked by then"),
        ({"plan": "[{unit: c, to: d.rear, after: []}, {unit: d, to: c.rear, after: []}]"},
         "plan.1", "the steps 'd', 'c' wait for each other"),
        ({"plan": "[{unit: c, to: a.left, name: x, after: [y]}, {undock: c, name: y}]"},
         "plan.0.after", "waits for itself"),
        ({"plan": "[{undock: c, after: [c]}]"}, "plan.0.after", "step 'c' waits for itself"),
        ({"plan": "[{undock: c, after: [x]}]"}, "plan.0.after.0", "no step named 'x'"),
        ({"plan": "[{undock: c, name: a}, {unit: c, to: a.left, name: a}, {undock: c, after: [a], name: z}]"},
         "plan.2.after.0", "2 steps are named 'a'"),
        ({"plan": "[{move: d, pose: {x_m: 0.8, y_m: 0.1}}]"}, "plan.0.pose", "0.000 m from 'a'"),
        ({"plan": "[{move: d, pose: {x_m: -1, y_m: -1}}, {move: c, pose: {x_m: -1.1, y_m: -1}}]"},
         "plan.1.pose", "from the end of 'd' (plan step 0)"),
        ({"plan": "[{move: d, pose: {x_m: -1, yawdeg: 3}}]"}, "plan.0.pose.yawdeg", "did you mean 'yaw_deg'"),
        ({"plan": "[{move: 3, pose: {x_m: -1}}]"}, "plan.0.move", "expected a"),
        ({"plan": "[{move: d, pose: {x_m: west}}]"}, "plan.0.pose.x_m", "expected a"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_named_with_its_mend(
    scene_file: Path, overrides: Mapping[str, str], place: str, mend: str
) -> None:
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file, overrides)
    assert f" {place}: " in str(caught.value)
    assert mend in str(caught.value)


def test_poses_of_units_in_a_ring_are_not_told_of_for_none_of_them_is_at_fault(scene_file: Path) -> None:
    with pytest.raises(SceneError, match="a ring") as caught:
        load_scene(scene_file, {"assembled": "[a.front-b.rear, b.front-c.rear, c.front-a.rear]"})
    assert "remove the pose" not in str(caught.value)


@pytest.mark.parametrize(
    "plan",
    [
        "[{undock: c}, {undock: b}]",
        "[{undock: c}, {unit: d, to: b.rear}]",
        "[{undock: c}, {name: back, unit: c, to: b.rear}]",
        "[{undock: c, after: []}, {unit: d, to: b.rear, after: []}]",
        "[{move: c, pose: {x_m: -1, y_m: -1}}]",
        "[{move: c, pose: {y_m: -1}}, {move: c, name: x, pose: {x_m: -1}}, {move: d, pose: {y_m: -1}}]",
        "[{move: c, pose: {x_m: -1, y_m: 1}, after: [d]}, {move: d, pose: {x_m: -1, y_m: -1}, after: []}]",
        "[{unit: d, to: a.left, after: []}, {undock: d, name: out}, {unit: c, to: a.left, after: []}]",
        "[{unit: d, to: c.rear, after: []}, {move: c, pose: {x_m: -1, y_m: -1}, after: []}]",
    ],
)
def test_what_the_steps_before_allow_is_allowed(scene_file: Path, plan: str) -> None:
    load_scene(scene_file, {"plan": plan})


def test_shapes_are_a_list_or_a_single_one(scene_file: Path) -> None:
    for text, count in (("{line: 3}", 1), ("[{line: 3}, {zigzag: 3}]", 2)):
        scene = load_scene(scene_file, {"plan": "[]", "shape": text})
        assert scene.shape is not None
        assert len(scene.shape) == count
    for text, place in (("{lime: 3}", "shape.lime"), ("[{line: 3}, {lime: 3}]", "shape.1.lime")):
        with pytest.raises(SceneError, match=f"{place}: unknown key; did you mean 'line'"):
            load_scene(scene_file, {"plan": "[]", "shape": text})
    with pytest.raises(SceneError, match="shape: expected at least 1 entry"):
        load_scene(scene_file, {"plan": "[]", "shape": "[]"})
