"""Checks of where moves end: in the arena, and not where something stands that stays there."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrr_scenes import load_scene
from msrr_scenes.errors import SceneError
from msrr_scenes.specs.scene import Scene

SCENE = """\
arena: {x_m: [-2.0, 2.5], y_m: [-1.5, 1.8]}
units:
  a: {number: 0, pose: {x_m: 1.5, y_m: 1.0}}
  b: {number: 1}
  c: {number: 2, pose: {x_m: 1.5, y_m: -0.8}}
assembled: [b.front-a.rear]
obstacles:
  post: {shape: box, length_m: 0.4, width_m: 0.2, pose: {x_m: -1.0}}
cameras: {overhead: {height_m: 5.0}}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "scene.yaml"


def load(path: Path, plan: str, **changes: str) -> Scene:
    path.write_text(f"{SCENE}plan: [{plan}]\n")
    return load_scene(path, changes)


def move(unit: str, x_m: float, y_m: float, yaw_deg: float = 0.0, *, name: str = "x") -> str:
    return f"{{move: {unit}, name: {name}, pose: {{x_m: {x_m}, y_m: {y_m}, yaw_deg: {yaw_deg}}}}}"


@pytest.mark.parametrize(("x_m", "y_m"), [(-2.0, -1.5), (2.5, 1.8)])
def test_a_move_ends_in_the_arena(path: Path, x_m: float, y_m: float) -> None:
    load(path, move("c", x_m, y_m))
    out = 0.01 if x_m > 0.0 else -0.01
    for end in ((x_m + out, y_m), (x_m, y_m + out)):
        with pytest.raises(SceneError, match=r"outside the arena: x from -2 to 2\.5, y from -1\.5 to 1\.8"):
            load(path, move("c", *end))


@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, 180.0])
def test_a_move_ends_as_far_from_an_obstacle_as_the_judge_asks(path: Path, yaw_deg: float) -> None:
    """The unit comes from the side of the pose; its footprint is turned as the pose is."""
    footprint = load(path, move("c", 0.0, 0.0)).geometry("c").footprint
    back = {0.0: -footprint[:, 0].min(), 90.0: footprint[:, 1].max(), 180.0: footprint[:, 0].max()}[yaw_deg]
    touching = -0.8 + float(back)
    load(path, move("c", touching + 0.021, 0.0, yaw_deg))
    near = move("c", touching + 0.019, 0.0, yaw_deg)
    with pytest.raises(SceneError, match=r"plan\.0\.pose: 'c' would stand 0\.019 m from 'post'"):
        load(path, near)
    load(path, near, **{"judge.min_clearance_m": "0.018"})
    load(path, near, **{"obstacles.post.appears_at_s": "5"})  # a unit may stand there by then


def test_a_unit_that_is_locked_stays_unless_it_has_a_step(path: Path) -> None:
    seat = move("c", 1.2, 1.0)
    with pytest.raises(SceneError, match=r"'c' would stand 0\.000 m from 'b'"):
        load(path, seat)
    load(path, f"{{undock: b}}, {move('b', 0.0, 0.0, name='away')}, {seat}")


@pytest.mark.parametrize("later", [False, True])
def test_a_unit_that_carries_nobody_else_by_then_makes_way(path: Path, later: bool) -> None:
    """A unit may move to where the one stands that carries it, unless that one carries a third one, too."""
    to_carrier = move("b", 1.5, 1.0)
    load(path, to_carrier)
    scene = SCENE.replace("a.rear]", "a.rear, c.front-a.left]").replace(", pose: {x_m: 1.5, y_m: -0.8}", "")
    third = f", {move('c', 0.0, 0.0, name='third')}" if later else ""
    path.write_text(f"{scene}plan: [{to_carrier}{third}]\n")
    with pytest.raises(SceneError, match=r"plan\.0\.pose: 'b' would stand 0\.000 m from 'a'"):
        load_scene(path)
    path.write_text(path.read_text().replace("plan: [", "plan: [{undock: c, name: out}, "))
    load_scene(path)
