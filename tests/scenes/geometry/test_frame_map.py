"""Robots of other makers: links by the names of this project, and what is said of a wrong map."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.frame_map import FrameMapError, MappedFrame
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.geometry.urdf_file import read_urdf

UNIT = read_unit(find_urdf("unit.urdf"))
ROUND = find_urdf("round.urdf")
PARTS = (
    MappedFrame("axle", "base_footprint"),
    MappedFrame("camera", "camera_link"),
    MappedFrame("wheel_left", "left_wheel_link"),
    MappedFrame("wheel_right", "right_wheel_link"),
    MappedFrame("port_front", "base_footprint", (0.13, 0.0, 0.0)),
)


def changed(folder: Path, old: str, new: str) -> Path:
    """The round robot with some text of its URDF changed."""
    text = ROUND.read_text()
    assert old in text
    path = folder / "changed.urdf"
    path.write_text(text.replace(old, new))
    return path


def test_a_robot_whose_links_have_other_names_is_the_same_robot(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.urdf"
    foreign.write_text(re.sub(r'(<link name|link)="(\w+)"', r'\1="their_\2"', UNIT.urdf.read_text()))
    names = [name for name in UNIT.frames if re.match("axle|camera|wheel|pin|tag|port_(?!.*funnel)", name)]
    mapped = read_unit(foreign, tuple(MappedFrame(name, f"their_{name}") for name in names))
    for name in names:
        np.testing.assert_array_equal(mapped.frame(name).matrix(), UNIT.frame(name).matrix())
    for same in ("wheel_radius", "track", "ports", "passive_ports", "pins", "tag_slots", "pin_height"):
        assert getattr(mapped, same) == getattr(UNIT, same)
    np.testing.assert_array_equal(mapped.footprint, UNIT.footprint)


def test_a_frame_may_be_a_pose_in_a_link_or_in_an_earlier_frame() -> None:
    """Also where the URDF has a link of that name for something else, which then gets another one."""
    frames = (
        MappedFrame("camera", "camera", (0.02, 0.0, 0.01), (0.0, 0.1, 0.0)),
        MappedFrame("tag_top", "camera", (0.0, 0.0, 0.05)),
    )
    unit = read_unit(UNIT.urdf, frames)
    X_UC = UNIT.frame("camera") @ SE3.from_xyz_rpy([0.02, 0.0, 0.01], [0.0, 0.1, 0.0])
    np.testing.assert_allclose(unit.frame("camera").matrix(), X_UC.matrix(), atol=1e-12)
    np.testing.assert_allclose(unit.frame("tag_top").p, X_UC.act([0.0, 0.0, 0.05]), atol=1e-12)
    np.testing.assert_array_equal(unit.frame("in_urdf_camera").p, UNIT.frame("camera").p)


def test_a_tag_that_is_moved_stays_one_tag() -> None:
    """The link that had its name before was a tag as well, with an id of its own."""
    frames = (MappedFrame("port_rear_marker_middle", "port_rear_marker_middle", (0.0, -0.055, 0.0)),)
    moved = read_unit(UNIT.urdf, frames)
    assert moved.tag_slots == UNIT.tag_slots
    assert (moved.ports, moved.pins) == (UNIT.ports, UNIT.pins)


def test_two_bodies_may_change_their_names() -> None:
    """Then left is right and the unit drives backwards, which is refused: the axle looks the other way."""
    frames = (MappedFrame("wheel_left", "wheel_right"), MappedFrame("wheel_right", "wheel_left"))
    with pytest.raises(GeometryError, match=r"x forward; the left wheel is at y = -0\.0650 m"):
        read_unit(UNIT.urdf, frames)


def test_both_wheels_turn_forward() -> None:
    """The right motor of the round robot is mounted the other way round."""
    drawn, mapped = (read_urdf(ROUND, frames).getroot() for frames in ((), PARTS))
    for root, right in ((drawn, "0 0 -1"), (mapped, "-0.0 -0.0 1.0")):
        axes = {j.get("name"): j.find("axis") for j in root.findall("joint")}
        found = [axes[f"{side}_wheel_joint"] for side in ("left", "right")]
        assert [axis.get("xyz") for axis in found if axis is not None] == ["0 0 1", right]


@pytest.mark.parametrize(
    ("frames", "frame", "text"),
    [
        (
            [MappedFrame("camera", "camera_lnk")],
            "camera",
            "round.urdf: no link 'camera_lnk' for 'camera'; did you",
        ),
        ([MappedFrame("camra", "camera_link")], "camra", "no frame of a unit; did you mean 'camera'?"),
        ([MappedFrame("pin_left", "mast", (0.1, 0, 0))], "pin_left", "is a body, so it is a link itself"),
        (
            [MappedFrame("pin_left", "mast"), MappedFrame("pin_right", "mast")],
            "pin_right",
            "'pin_left' already",
        ),
    ],
)
def test_a_map_that_does_not_fit_is_refused(frames: list[MappedFrame], frame: str, text: str) -> None:
    with pytest.raises(FrameMapError, match=re.escape(text)) as refused:
        read_unit(ROUND, tuple(frames))
    assert refused.value.frame == frame


def _carried(joint: str, parent: str, child: str) -> str:
    return f'<joint name="{joint}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            '<sphere radius="0.04"/>',
            '<box size="1 1 1"/>',
            "'wheel_left' has no radius; .* in that link itself",
        ),
        (
            '<collision><origin xyz="0 0 0"/><geometry><sphere radius="0.04"/>',
            '<collision><origin xyz="0.004 0.002 0"/><geometry><sphere radius="0.04"/>',
            r"collision shape of 'wheel_left' is \(0\.0040, -0\.0020\) m off its axis",
        ),
        (
            '<origin xyz="0 0 0"/><geometry><sphere radius="0.04"/>',
            '<origin xyz="0 0 0" rpy="1.5708 0 0"/><geometry><cylinder radius="0.04" length="0.02"/>',
            r"a cylinder, has its axis along \(0\.000, -?0\.000, -?1\.000\) of the frame axle",
        ),
        ('xyz="0 0.075 0"', 'xyz="0.01 0.075 0"', r"that point is at \(0\.0050, 0\.0000, 0\.0000\) m"),
        ('xyz="0 0 0.04"', 'xyz="0 0 0.05"', r"that point is at \(0\.0000, 0\.0000, 0\.0100\) m"),
        ('rpy="-1.570796327 0 0"', "", r"'wheel_left' turns about \(0\.000, 0\.000, 1\.000\)"),
        ('name="left_wheel_joint" type="continuous"', 'name="w" type="fixed"', "continuous, found fixed"),
        (
            'name="camera_joint" type="fixed"',
            'name="pan" type="revolute"',
            r"joint 'pan' \(revolute\) moves the frame 'camera'; make it a fixed one",
        ),
        (
            '<box size="0.2397 0.16 0.037"/>',
            '<mesh filename="package://elsewhere/base.obj"/>',
            "the URDF is in no folder 'elsewhere'",
        ),
        ('<box size="0.2397 0.16 0.037"/>', '<mesh filename="base.stl"/>', "has to be an OBJ file"),
        # The frame map adds a link of that name for us, but not for others who read the file.
        (
            '<parent link="base_link"/><child link="left',
            '<parent link="port_front"/><child link="left',
            "names the link 'port_front' as its parent, which is not in the file; did you mean",
        ),
        # PyBullet ends the process on the first two.
        ("</robot>", '<link name="mast"/></robot>', "two links are called 'mast'; rename or remove one"),
        (
            "</robot>",
            '<link name="stray"/></robot>',
            "no joint carries 'base_footprint', 'stray', and a robot has one such link, its root; join",
        ),
        (
            "</robot>",
            _carried("twice", "mast", "lid_link") + "</robot>",
            "the joints 'lid_joint' and 'twice' both carry the link 'lid_link'; remove one",
        ),
        (
            'size="0.2397 0.16 0.037"',
            'size="0.2397 -0.16 0.037"',
            "'base_link': a <box> needs a size of three",
        ),
        (  # the links of the whole robot in a circle
            "</robot>",
            _carried("back", "caster_rear", "base_footprint") + "</robot>",
            "'caster_rear', 'base_footprint' carry each other in a circle, by .* 'caster_rear_joint', 'back'",
        ),
        (  # links beside it
            "</robot>",
            '<link name="p"/><link name="q"/>'
            + _carried("pq", "p", "q")
            + _carried("qp", "q", "p")
            + "</robot>",
            "the links 'q', 'p' carry each other in a circle, by the joints 'pq', 'qp', and a robot has one",
        ),
        (
            "</robot>",
            '<link name="p"/>' + _carried("pp", "p", "p") + "</robot>",
            "the links 'p' carry each other in a circle",
        ),
        (' name="round"', "", "the <robot> has no name; give it one"),
        ('<material name="deck"/>', "<material/>", "link 'base_link': a <material> has no name"),
        ("</robot>", "<material/></robot>", "the <robot>: a <material> has no name"),
        # The log names the joints of the wheels, and PyBullet loads no URDF with a joint that has no name.
        (
            'joint name="left_wheel_joint"',
            "joint",
            "link 'left_wheel_link': the joint that carries it has no name; give it one",
        ),
        (
            '"caster_front"/><origin xyz="0.09 0 0.012"',
            '"caster_front"/><origin xyz="0.09 O 0.012"',
            "link 'caster_front': joint '.*': the xyz of <origin> .* three numbers, found '0.09 O 0.012'",
        ),
        (
            '<axis xyz="0 0 -1"',
            '<axis xyz="0 0"',
            "link 'right_wheel_link': .*: the xyz of <axis> has to be three numbers, found '0 0'",
        ),
        (
            '<axis xyz="0 0 -1"',
            '<axis xyz="0 0 0"',
            "link 'right_wheel_link': joint 'right_wheel_joint': its <axis> has no direction",
        ),
        (
            '<collision><origin xyz="0.12 0 0.016"',
            '<collision><origin rpy="0 nan 0"',
            "link 'base_link': <collision>: the rpy of <origin> has to be three numbers, found '0 nan 0'",
        ),
    ],
)
def test_a_drawing_that_cannot_be_used_is_refused_by_name(
    tmp_path: Path, old: str, new: str, text: str
) -> None:
    path = changed(tmp_path, old, new)
    with pytest.raises(GeometryError, match=text):
        read_unit(path, PARTS)


@pytest.mark.parametrize(("right", "accepted"), [("0.040005", True), ("0.0401", False)])
def test_wheels_are_equal_to_the_rounding_of_a_drawing(right: str, accepted: bool, tmp_path: Path) -> None:
    """One of another radius was some micrometres off the floor, and the robot slid while it stood."""
    left, tyre, rest = ROUND.read_text().rpartition('<sphere radius="0.04"/>')
    path = tmp_path / "wheels.urdf"
    path.write_text(left + tyre.replace("0.04", right) + rest)
    if accepted:
        assert read_unit(path, PARTS).wheel_radius == 0.04
        return
    with pytest.raises(GeometryError, match=r"radii of 0\.04 m and 0\.0401 m; make them equal\. .* as_built"):
        read_unit(path, PARTS)


def test_macros_are_to_be_expanded(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf.xacro"
    path.write_text('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="r"/></robot>')
    with pytest.raises(GeometryError, match=r"expand them first: xacro robot\.urdf\.xacro > robot\.urdf"):
        read_urdf(path)


def test_meshes_of_a_package_are_found_above_the_urdf(tmp_path: Path) -> None:
    folder = tmp_path / "my_robot" / "urdf"
    folder.mkdir(parents=True)
    box = '<box size="0.2397 0.16 0.037"/>'
    path = changed(folder, box, '<mesh filename="package://my_robot/meshes/base.obj"/>')
    mesh = tmp_path / "my_robot" / "meshes" / "base.obj"
    mesh.parent.mkdir()
    mesh.write_text("v 0 0 0\nv 0.3 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 3\nf 1 2 4\n")
    assert [solid.mesh for solid in read_unit(path, PARTS).solids if solid.mesh] == [mesh]


def test_the_track_is_the_distance_between_the_points_on_which_the_wheels_roll(tmp_path: Path) -> None:
    """Wheels of CAD programs stand beside the frames of their joints; a hub is no tyre."""
    tyre = '<origin xyz="0 0 0"/><geometry><sphere radius="0.04"/>'
    hub = '<geometry><cylinder radius="0.01" length="0.05"/></geometry></collision><collision>'
    for left, right in ((0.02, -0.02), (-0.01, 0.01)):
        text = ROUND.read_text()
        for y in (left, right):  # z of the link is y of the axle
            text = text.replace(tyre, f'{hub}<origin xyz="0 0 {y}"/><geometry><sphere radius="0.04" />', 1)
        (tmp_path / "wide.urdf").write_text(text)
        unit = read_unit(tmp_path / "wide.urdf", PARTS)
        assert (unit.track, unit.wheel_radius) == (pytest.approx(0.15 + 2.0 * left), 0.04)
