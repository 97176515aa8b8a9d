"""Robots that do not stand still in the physics are refused before a trial."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrr_bullet.trial.check import check_trial
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import load_scene


def _with_arm(folder: Path, damping: float) -> str:
    """The shipped robot with an arm of 10 g on its top that turns about the vertical."""
    arm = f"""
    <link name="arm">
      <inertial>
        <origin xyz="0.05 0 0"/><mass value="0.01"/>
        <inertia ixx="1e-6" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/>
      </inertial>
    </link>
    <joint name="shoulder" type="continuous">
      <parent link="body"/><child link="arm"/><origin xyz="0 0 0.13"/><axis xyz="0 0 1"/>
      <dynamics damping="{damping}"/>
    </joint>
    """
    own = folder / "arm.urdf"
    own.write_text(find_urdf("unit.urdf").read_text().replace("</robot>", arm + "</robot>"))
    return str(own)


def test_a_joint_that_the_engine_can_simulate_is_accepted(tmp_path: Path) -> None:
    check_trial(load_scene("close_range", {"units.a.urdf": _with_arm(tmp_path, 0.001)}))


def test_a_joint_that_throws_the_robot_is_named(tmp_path: Path) -> None:
    scene = load_scene("close_range", {"units.a.urdf": _with_arm(tmp_path, 1.0)})
    with pytest.raises(SceneError, match=r"arm\.urdf: a does not stand still.*\(shoulder\)"):
        check_trial(scene)
    check_trial(scene.model_copy(update={"plant": "unicycle"}))


@pytest.mark.parametrize(
    "floor",
    ["{ridge_m: 0.003}", "{slope_x_deg: 10, slope_y_deg: -10}", "{slope_x_deg: 10, friction_percent: -90}"],
)
def test_what_the_floor_does_to_a_robot_is_no_fault_of_the_robot(floor: str) -> None:
    check_trial(load_scene("close_range", {"as_built": f"{{floor: {floor}}}"}))
