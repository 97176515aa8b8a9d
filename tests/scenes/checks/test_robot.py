"""Checks of how a robot is drawn: each mistake is placed and named, and what is not one is accepted."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.mount import MountSpec
from tests.conftest import not_none

FRAMES = "units.a.frames"
ROUND = find_urdf("round.urdf")


def without_inertial(folder: Path, *links: str) -> Mapping[str, str]:
    """Give unit a a copy of the round robot in which these links have no inertial data."""
    text = ROUND.read_text()
    for link in links:
        text, found = re.subn(rf'(<link name="{link}">\s*)<inertial>.*?</inertial>', r"\1", text, flags=re.S)
        assert found == 1, link
    (folder / "light.urdf").write_text(text)
    return {"units.a.urdf": str(folder / "light.urdf")}


@pytest.mark.parametrize(
    ("overrides", "place", "says"),
    [
        (
            {"port_rear_hole_left": "socket_bottom_right", "port_rear_hole_right": "socket_bottom_left"},
            "port_rear_hole_left",
            "at y = -0.0400 m and port_rear_hole_right at 0.0400 m in the dock frame of the port",
        ),
        (
            {"pin_left": "latch_pin_right", "pin_right": "latch_pin_left"},
            "pin_left",
            "pin_left is at y = -0.0400 m of port_front",
        ),
        (
            {"port_front.x_m": "0.148"},
            "port_front",
            "pin_left does not stand out of the face: it ends 0.0 mm behind port_front",
        ),
        (
            {"port_rear_marker_upper": "{link: base_footprint, x_m: -0.07, z_m: 0.19}"},
            "port_rear_marker_upper",
            "tag port_rear_marker_upper does not face out of the port, but down; x of port_rear points back",
        ),
        (
            {"port_rear_marker_left.roll_deg": "180", "port_rear_marker_right.pitch_deg": "180"},
            "port_rear_marker_left",
            "tags port_rear_marker_left, port_rear_marker_right do not face out of the port, but forward",
        ),
        (
            {"port_rear": "{link: base_footprint, x_m: -0.13}"},
            "port_rear_marker_left",
            "but backward; x of port_rear points forward",
        ),
        (
            {"camera": "{link: camera_link, roll_deg: -90, yaw_deg: -90}"},
            "camera",
            "the camera looks to the right, and port_front, by which this robot docks, faces forward. Is it",
        ),
        (
            {"port_front.yaw_deg": "180"},
            "port_front",
            "port_front faces backward, away from what the camera looks at, and has pin_left on its right",
        ),
        ({"tag_top.roll_deg": "0"}, "tag_top", "does not face up, but down"),
        ({"camera": "{link: camera_link, z_m: -0.2}"}, "camera", "the camera is 10.0 mm below the floor"),
    ],
)
def test_a_frame_that_is_turned_or_swapped_is_named(
    overrides: Mapping[str, str], place: str, says: str
) -> None:
    changes = {f"{FRAMES}.{key}": value for key, value in overrides.items()}
    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", {**changes, "cameras.overhead": "{}"})
    assert f"{FRAMES}.{place}: round.urdf: " in str(caught.value)
    assert says in str(caught.value)


def test_the_rotations_that_messages_advise_are_those_of_the_drawing() -> None:
    """Of a tag in a link with x forward, of one in its port, and of a camera in an optical frame."""
    board = load_scene("round_robots").geometry("a").frame("port_rear_marker_left").R
    port = load_scene("round_robots").geometry("a").frame("port_rear").R
    np.testing.assert_allclose(MountSpec(roll_deg=-90, yaw_deg=-90).X.R, board, atol=1e-8)
    np.testing.assert_allclose(port @ MountSpec(roll_deg=-90, yaw_deg=90).X.R, board, atol=1e-8)
    optical = SE3.from_xyz_rpy(
        [0.0, 0.0, 0.0], [-0.5 * np.pi, 0.0, -0.5 * np.pi]
    )  # as ROS has it in camera_link
    camera = optical @ MountSpec(pitch_deg=-90, yaw_deg=90).X
    np.testing.assert_allclose(camera.R, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("link", ["base_link", "left_wheel_link", "caster_rear", "latch_pin_right", "socket"])
def test_a_body_without_a_mass_is_named_as_its_urdf_does(link: str, tmp_path: Path) -> None:
    light = without_inertial(tmp_path, link)
    with pytest.raises(SceneError, match=rf"units\.a\.urdf: light\.urdf: no <inertial> .*: {link}\."):
        load_scene("round_robots", light)
    load_scene("round_robots", {**light, "plant": "unicycle", "perception": "parametric"})  # not weighed


@pytest.mark.parametrize(
    ("old", "new"), [("<inertia ", "<inertial "), ('mass value="0.02"', 'mass value="0"'), ("0.02", "heavy")]
)
def test_inertial_data_have_a_mass_and_an_inertia(old: str, new: str, tmp_path: Path) -> None:
    """PyBullet refuses the one with lines of its own on the terminal."""
    head, caster, rest = ROUND.read_text().partition('<link name="caster_rear">')
    (tmp_path / "light.urdf").write_text(head + caster + rest.replace(old, new, 1))
    with pytest.raises(SceneError, match=r"light\.urdf: no <inertial> .*: caster_rear\."):
        load_scene("round_robots", {"units.a.urdf": str(tmp_path / "light.urdf")})


@pytest.mark.parametrize(
    ("link", "values"),
    [
        ("base_link", {"ixx": "3"}),
        ("base_link", {"ixy": "3"}),
        ("left_wheel_link", {"iyy": "0"}),
        ("left_wheel_link", {"ixx": "-1e-4"}),
        ("right_wheel_link", {"ixx": "1e-4", "iyy": "1e-4", "izz": "2e-4"}),  # of a disc without a thickness
    ],
)
def test_an_inertia_that_no_body_has_is_named_with_its_link(
    link: str, values: dict[str, str], tmp_path: Path
) -> None:
    tree = ElementTree.parse(ROUND)
    inertia = not_none(tree.getroot().find(f"link[@name='{link}']/inertial/inertia"))
    inertia.attrib.update(values)
    tree.write(tmp_path / "bad.urdf")
    bad = {"units.a.urdf": str(tmp_path / "bad.urdf")}
    with pytest.raises(SceneError, match=rf"units\.a\.urdf: bad\.urdf: link '{link}' has an <inertia>"):
        load_scene("round_robots", bad)
    load_scene("round_robots", {**bad, "plant": "unicycle", "perception": "parametric"})  # not weighed


def test_parts_without_collision_shapes_need_no_mass(tmp_path: Path) -> None:
    load_scene("round_robots", without_inertial(tmp_path, "board_link", "camera_link"))


def test_a_robot_to_which_nobody_docks_needs_no_tags_at_its_port() -> None:
    """It has the socket with its holes; to dock to it, one tag of any name is enough."""
    named = load_scene("round_robots").units["a"].frames
    bare = {name: frame.model_dump() for name, frame in named.items() if "_marker_" not in name}
    no_tags = {"units.a.frames": bare, "units.a.tag_sizes_m": {}}
    load_scene("round_robots", no_tags)
    no_tags = {"units.b.frames": bare, "units.b.tag_sizes_m": {}}
    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", no_tags)
    assert "plan.0.to: port 'rear' of 'b' has no tag" in str(caught.value)
    assert "a link or frame port_rear_marker_<tag>" in str(caught.value)
    one = {**bare, "port_rear_marker_any": {"link": "board_link"}}
    load_scene("round_robots", {**no_tags, "units.b.frames": one})


@pytest.mark.parametrize("part", ["inertial", "visual"])
def test_a_malformed_place_of_a_part_is_named_with_its_link(part: str, tmp_path: Path) -> None:
    tree = ElementTree.parse(ROUND)
    origin = not_none(tree.getroot().find(f"link[@name='left_wheel_link']/{part}/origin"))
    origin.set("xyz", "0 0 zero")
    tree.write(tmp_path / "bad.urdf")
    says = rf"bad\.urdf: link 'left_wheel_link': <{part}>: the xyz of <origin> .*, found '0 0 zero'"
    with pytest.raises(SceneError, match=says):
        load_scene("round_robots", {"units.a.urdf": str(tmp_path / "bad.urdf")})


@pytest.mark.parametrize("value", ["nan", "inf", "", "1 2", "1e-4 kg"])
def test_a_malformed_moment_of_inertia_is_named_with_its_link(value: str, tmp_path: Path) -> None:
    tree = ElementTree.parse(ROUND)
    inertia = not_none(tree.getroot().find("link[@name='left_wheel_link']/inertial/inertia"))
    inertia.set("iyy", value)
    tree.write(tmp_path / "bad.urdf")
    says = rf"link 'left_wheel_link': <inertial>: the iyy of <inertia> has to be a number, found '{value}'"
    with pytest.raises(SceneError, match=says):
        load_scene("round_robots", {"units.a.urdf": str(tmp_path / "bad.urdf")})


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
@pytest.mark.parametrize("link", ["latch_pin_left", "latch_pin_right"])
def test_a_pin_without_a_shape_is_named(link: str, plant: str, tmp_path: Path) -> None:
    """A robot with the other pin alone tried until it gave up."""
    tree = ElementTree.parse(ROUND)
    pin = not_none(tree.getroot().find(f"link[@name='{link}']"))
    for shape in pin.findall("collision"):
        pin.remove(shape)
    tree.write(tmp_path / "bare.urdf")
    bare = {"units.a.urdf": str(tmp_path / "bare.urdf"), "plant": plant}
    frame = link.removeprefix("latch_")
    says = rf"{FRAMES}\.{frame}: bare\.urdf: {frame} has no collision shape"
    with pytest.raises(SceneError, match=says):
        load_scene("round_robots", bare)
