"""Checks of how a robot stands: what keeps it from standing level or from turning is named."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import load_scene

TEXT = find_urdf("round.urdf").read_text()
FRONT = '<child link="caster_front"/><origin xyz="0.09 0 0.012"/>'
REAR = '<child link="caster_rear"/><origin xyz="-0.09 0 0.012"/>'
HEAVY = '<origin xyz="0 0 0.01"/><mass value="2.4"/>'


def changed(folder: Path, *changes: tuple[str, str]) -> dict[str, str]:
    """Give unit a the round robot with some text of its URDF changed."""
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "other.urdf").write_text(text)
    return {"units.a.urdf": str(folder / "other.urdf")}


def moved(caster: str, x: float, z: float) -> tuple[str, str]:
    return caster, re.sub('xyz=".*"', f'xyz="{x} 0 {z}"', caster)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            [moved(FRONT, 0.09, 0.008), moved(REAR, -0.09, 0.008)],
            "caster_front and caster_rear keep the wheels 4 mm above the floor",
        ),
        (
            [(HEAVY, HEAVY.replace("0 0", "0.03 0")), moved(FRONT, 0.09, 0.015)],
            "it stands askew by 1.9 deg: its centre of mass is 22 mm ahead of the axle, and what carries it "
            "there is caster_front, at z = 3.0 mm",
        ),
        (
            [(HEAVY, HEAVY.replace("0 0", "-0.03 0")), moved(FRONT, 0.09, 0.010)],
            "caster_front and caster_rear keep the wheels 1 mm",
        ),
        (
            [moved(FRONT, 0.09, 0.01199), moved(REAR, -0.09, 0.01199)],
            "the wheels 0.01 mm above the floor; they reach to z = -0.01 and -0.01 mm, the wheels to "
            "0; let one of them end above the floor",
        ),
        (
            [(HEAVY, HEAVY.replace("0 0", "0.06 0")), moved(FRONT, 0.03, 0.012)],
            "it tips over: its centre of mass is 46 mm ahead of the axle, and no caster",
        ),
        (
            [('<contact><lateral_friction value="0"/></contact>', "")],
            "slides over the floor, and its link says nothing of friction",
        ),
    ],
)
def test_a_robot_that_does_not_stand_level_or_sticks_is_told_why(
    changes: list[tuple[str, str]], says: str, tmp_path: Path
) -> None:
    own = changed(tmp_path, *changes)
    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", own)
    assert "units.a.urdf: other.urdf: " in str(caught.value)
    assert says in str(caught.value)
    load_scene("round_robots", {**own, "plant": "unicycle"})  # stands on nothing


@pytest.mark.parametrize(
    "changes",
    [
        [moved(FRONT, 0.09, 0.022)],  # above the floor, and the mass is behind
        [moved(REAR, -0.09, 0.0123)],
        [
            (HEAVY, HEAVY.replace("0 0", "0.02 0")),
            ('<contact><lateral_friction value="0"/>', '<contact><lateral_friction value="0.1"/>'),
        ],
    ],
)
def test_a_robot_on_one_caster_or_on_a_worn_one_is_accepted(
    changes: list[tuple[str, str]], tmp_path: Path
) -> None:
    load_scene("round_robots", changed(tmp_path, *changes))


@pytest.mark.parametrize("z_m", ["-0.0005", "0.0005"])
def test_the_floor_is_what_the_wheels_reach_to_wherever_the_axle_is_drawn(z_m: str) -> None:
    """Half a millimetre above or below the ground."""
    axle = f"{{link: base_footprint, z_m: {z_m}}}"
    load_scene("round_robots", {f"units.{unit}.frames.axle": axle for unit in "ab"})
