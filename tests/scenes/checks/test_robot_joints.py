"""Joints that a URDF may have and PyBullet cannot simulate."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import load_scene

ROUND = find_urdf("round.urdf")
CASTER = '<joint name="caster_front_joint" type="fixed">'


def with_joints(folder: Path, old: str, new: str) -> Mapping[str, str]:
    text = ROUND.read_text()
    assert old in text
    (folder / "joints.urdf").write_text(text.replace(old, new))
    return {"units.a.urdf": str(folder / "joints.urdf")}


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("floating", "is floating, and PyBullet would hold it fast; make it a fixed one"),
        (
            "revolute",
            'is revolute and has no <limit>; give it one with lower="..." and upper="...", or make ',
        ),
        ("prismatic", "is prismatic and has no <limit>; "),
    ],
)
def test_a_joint_that_pybullet_does_not_load_is_named(kind: str, says: str, tmp_path: Path) -> None:
    joints = with_joints(tmp_path, CASTER, CASTER.replace("fixed", kind))
    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", joints)
    assert f"units.a.urdf: joints.urdf: link 'caster_front': joint 'caster_front_joint' {says}" in str(
        caught.value
    )
    load_scene("round_robots", {**joints, "plant": "unicycle", "perception": "parametric"})  # not loaded
