"""Joints of a URDF: malformed ones are refused by name, and axes become unit vectors."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.geometry.urdf_file import read_urdf

UNIT = find_urdf("unit.urdf")
WHEEL = "wheel_left_joint"
TURNS = f'<joint name="{WHEEL}" type="continuous">'
CASTER = '<joint name="caster_front_joint" type="fixed">'


def changed(folder: Path, old: str, new: str) -> Path:
    text = UNIT.read_text()
    assert old in text
    (folder / "changed.urdf").write_text(text.replace(old, new, 1))
    return folder / "changed.urdf"


def axis(path: Path, joint: str) -> str | None:
    found = read_urdf(path).getroot().find(f"joint[@name='{joint}']/axis")
    return None if found is None else found.get("xyz")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("0 1 0", "0.0 1.0 0.0"),
        ("0 2 0", "0.0 1.0 0.0"),
        ("0 -0.5 0", "-0.0 1.0 -0.0"),
    ],
)
def test_the_axis_of_a_wheel_is_a_unit_vector(old: str, new: str, tmp_path: Path) -> None:
    """PyBullet turns a wheel twice as fast about an axis of length 2."""
    path = changed(tmp_path, '<axis xyz="0 1 0"/>', f'<axis xyz="{old}"/>')
    # One that is a unit vector already stays as it is written.
    assert axis(path, WHEEL) == (old if old == "0 1 0" else new)
    assert axis(path, "wheel_right_joint") == "0 1 0"


@pytest.mark.parametrize(
    ("drawn", "read"),
    [('<axis xyz="0 0 3"/>', "0.0 0.0 1.0"), ('<axis xyz="0.6 0 0.8"/>', "0.6 0 0.8"), ("", "1 0 0")],
)
def test_so_is_the_axis_of_a_caster(drawn: str, read: str, tmp_path: Path) -> None:
    path = changed(tmp_path, CASTER, CASTER.replace("fixed", "continuous") + drawn)
    assert axis(path, "caster_front_joint") == read
    # Programs that draw robots write an axis of zeros for fixed joints.
    assert axis(changed(tmp_path, CASTER, CASTER + '<axis xyz="0 0 0"/>'), "caster_front_joint") == "0 0 0"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        # PyBullet ends the process on the first two.
        (
            WHEEL,
            "wheel_right_joint",
            "link 'wheel_left': another joint is called 'wheel_right_joint' as well",
        ),
        (CASTER, CASTER.replace(' type="fixed"', ""), "'caster_front_joint': it has no type. Types: fixed, "),
        (
            CASTER,
            CASTER.replace("fixed", "Fixed"),
            "unknown type 'Fixed'; did you mean 'fixed'? Types: fixed",
        ),
        (CASTER, CASTER.replace("fixed", "weld"), "unknown type 'weld'. Types: fixed"),
        (
            CASTER,
            CASTER.replace("fixed", "continuous") + '<axis xyz="0 0 0"/>',
            "link 'caster_front': joint 'caster_front_joint': its <axis> has no direction",
        ),
        (
            CASTER,
            CASTER.replace("fixed", "continuous") + '<axis xyz="nan 0 1"/>',
            "link 'caster_front': joint 'caster_front_joint': the xyz of <axis> has to be three numbers",
        ),
        (
            CASTER,
            CASTER.replace("fixed", "revolute") + '<limit lower="-90deg" upper="1"/>',
            "link 'caster_front': joint 'caster_front_joint': the lower of <limit> has to be a number, found",
        ),
        (
            TURNS,
            TURNS + '<dynamics damping="nan"/>',
            f"'{WHEEL}': the damping of <dynamics> has to be a number",
        ),
        (
            TURNS,
            TURNS + '<dynamics friction="low"/>',
            "the friction of <dynamics> has to be a number, found 'low'",
        ),
        (TURNS, TURNS + "<dynamics/>", "its <dynamics> has neither damping nor friction; remove it"),
        (TURNS, TURNS + '<dynamics damping="-1"/>', "its damping has to be 0 or above, found '-1'"),
    ],
)
def test_a_malformed_joint_is_named_with_its_link(old: str, new: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(GeometryError, match=re.escape(says)):
        read_urdf(changed(tmp_path, old, new))
