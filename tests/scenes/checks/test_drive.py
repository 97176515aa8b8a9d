"""Checks of a robot against its motors."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import load_scene, shipped_scenes

BODY = '<mass value="2.4"/><inertia ixx="0.0105" ixy="0" ixz="0" iyy="0.0105" iyz="0" izz="0.0165"/>'


def weighing(folder: Path, unit: str, kg: float, izz: float = 0.0165) -> Mapping[str, str]:
    """Give a unit the round robot with a body of another mass and inertia about the vertical."""
    text = find_urdf("round.urdf").read_text()
    assert BODY in text
    inertia = f'<inertia ixx="{izz}" ixy="0" ixz="0" iyy="{izz}" iyz="0" izz="{izz}"/>'
    name = f"weighs_{kg}_{izz}.urdf"
    (folder / name).write_text(text.replace(BODY, f'<mass value="{kg}"/>{inertia}'))
    return {f"units.{unit}.urdf": str(folder / name)}


def test_a_robot_too_heavy_for_its_motors_is_told_by_how_much(tmp_path: Path) -> None:
    """4000 kg where grams were meant; 2 x 0.15 N m on wheels of 40 mm push with 7.5 N."""
    heavy = weighing(tmp_path, "a", 4000.0)
    with pytest.raises(SceneError, match=r"units\.a\.urdf: weighs_4000\.0_") as caught:
        load_scene("round_robots", heavy)
    says = re.search(
        r"weighs (\S+) kg, 4000 kg of it link 'base_link'\. .* by (\S+) m/s\^2", str(caught.value)
    )
    assert says
    assert float(says[1]) * float(says[2]) == pytest.approx(7.5, rel=0.01)
    assert "limits.a_max_mps2 promises 0.5" in str(caught.value)
    load_scene("round_robots", {**heavy, "motors.torque_nm": "80"})
    load_scene("round_robots", {**heavy, "limits.a_max_mps2": "0.0018", "limits.dw_max_radps2": "1"})
    load_scene("round_robots", {**heavy, "plant": "unicycle"})  # has no motors


def test_the_acceleration_that_the_limits_promise_is_the_bound(tmp_path: Path) -> None:
    """7.5 N accelerate 15 kg by 0.5 m/s^2; the wheels, pins and the other links weigh 0.54 kg."""
    load_scene("round_robots", weighing(tmp_path, "a", 14.4))
    with pytest.raises(SceneError, match="it weighs"):
        load_scene("round_robots", weighing(tmp_path, "a", 14.5))


def test_a_robot_that_is_too_slow_to_turn_is_told_so(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"rad/s\^2, and limits\.dw_max_radps2 promises 5"):
        load_scene("round_robots", weighing(tmp_path, "a", 10.0, 0.2))


def test_a_robot_that_never_drives_may_weigh_anything(tmp_path: Path) -> None:
    load_scene("round_robots", weighing(tmp_path, "b", 4000.0))


@pytest.mark.parametrize(
    ("name", "plan", "driving"),
    [
        ("bystander", "[{unit: a, to: b.rear}]", "units.a.urdf: "),
        ("bystander", "[{unit: a, to: b.rear}, {unit: c, to: a.rear}]", "units.a.urdf and units.c.urdf: "),
        ("assemble_tee", None, "units.a.urdf and 7 more units: "),
    ],
)
def test_units_of_a_plan_or_a_shape_drive(name: str, plan: str | None, driving: str) -> None:
    steps = {} if plan is None else {"plan": plan}
    with pytest.raises(SceneError, match=r"limits\.a_max_mps2 promises 4") as caught:
        load_scene(name, {**steps, "limits.a_max_mps2": "4"})
    assert driving in str(caught.value)


def test_motors_that_a_scene_makes_weak_are_a_fault_that_can_be_tried() -> None:
    assert "seized_drive" in shipped_scenes()
    assert load_scene("seized_drive").motors.torque_nm < 1e-4


def damped(folder: Path, value: float) -> Mapping[str, str]:
    """Give unit a the round robot with wheels of this damping [N m s/rad]."""
    text, joint = find_urdf("round.urdf").read_text(), '<joint name="left_wheel_joint" type="continuous">'
    assert joint in text
    (folder / "damped.urdf").write_text(text.replace(joint, f'{joint}<dynamics damping="{value}"/>'))
    return {"units.a.urdf": str(folder / "damped.urdf")}


def test_a_damping_that_leaves_the_motors_too_little_is_told_by_how_much(tmp_path: Path) -> None:
    """At 0.4 m/s the wheels of 40 mm turn at 10 rad/s; 2.94 kg need 0.03 N m of each for 0.5 m/s^2."""
    load_scene("round_robots", {**damped(tmp_path, 0.011), "limits.dw_max_radps2": "1"})
    slow = damped(tmp_path, 0.05)
    says = (
        r"units\.a\.urdf: damped\.urdf: .* damping of 0\.05 N m s/rad, which takes 0\.5 N m of the 0\.15 N m"
    )
    for torque in ({}, {"motors.torque_nm": "0.15"}):  # the latter says nothing about losses
        with pytest.raises(SceneError, match=says):
            load_scene("round_robots", {**slow, **torque})
    load_scene("round_robots", {**slow, "motors.torque_nm": "0.8"})
    load_scene("round_robots", {**slow, "limits.v_max_mps": "0.05", "limits.v_close_mps": "0.05"})
    load_scene("round_robots", {**slow, "motors.torque_nm": "1e-5"})  # a seized drive
    load_scene("round_robots", {**slow, "plant": "unicycle"})  # has no wheels
