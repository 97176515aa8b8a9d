"""The same robot drawn by other names and in other frames is the same robot."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import UnitGeometry, find_urdf, read_unit
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.bodies import TagsSpec

UNIT = read_unit(find_urdf("unit.urdf"))
Drawn = Callable[[str], UnitGeometry]


@pytest.fixture
def drawn(tmp_path: Path) -> Drawn:
    """Writes a URDF and reads it; the scene's checks have to accept it for both units of a scene."""

    def draw(text: str) -> UnitGeometry:
        path = tmp_path / "drawn.urdf"
        path.write_text(text)
        load_scene(
            "close_range", {**dict.fromkeys(("units.a.urdf", "units.b.urdf"), str(path)), "units.b.number": 4}
        )
        return read_unit(path)

    return draw


def _link(name: str, shape: str, parent: str, xyz: str, collides: bool = True) -> str:
    """A massless link with a shape, fixed to another one."""
    kind = "collision" if collides else "visual"
    return (
        f'<link name="{name}"><{kind}><geometry>{shape}</geometry></{kind}></link>'
        f'<joint name="{name}_joint" type="fixed"><parent link="{parent}"/><child link="{name}"/>'
        f'<origin xyz="{xyz}"/></joint></robot>'
    )


def test_casters_may_be_called_wheels(drawn: Drawn) -> None:
    """They counted as driven wheels, so that nothing seemed to carry the robot."""
    geometry = drawn(UNIT.urdf.read_text().replace("caster_", "wheel_"))
    assert (geometry.wheel_radius, geometry.track) == (UNIT.wheel_radius, UNIT.track)


@pytest.mark.parametrize("collides", [False, True])
def test_a_cover_of_the_pins_is_no_pin(drawn: Drawn, collides: bool) -> None:
    """It had to have a mass, and its shape was measured as that of a pin."""
    text = UNIT.urdf.read_text()
    inertial = re.search(r"<inertial>.*?</inertial>", text, re.DOTALL)
    assert inertial is not None
    plate = '<box size="0.002 0.06 0.01"/>'
    more = _link("pin_cover", plate, "port_front", "-0.02 0 0.06", collides)
    if collides:
        more = more.replace('<link name="pin_cover">', f'<link name="pin_cover">{inertial[0]}')
    geometry = drawn(text.replace("</robot>", more))
    assert geometry.pins == UNIT.pins
    assert geometry.pin_height == UNIT.pin_height


def test_pins_in_another_frame_are_as_high(drawn: Drawn) -> None:
    """Their height, by which the judge measures the gap of the faces, was that of the shapes' origins."""
    text = UNIT.urdf.read_text()
    for side in ("left", "right"):
        joint = re.search(rf'<joint name="pin_{side}_joint".*?<origin xyz="([^"]*)"', text, re.DOTALL)
        assert joint is not None
        x, y, z = joint[1].split()
        text = text.replace(joint[0], joint[0].replace(joint[1], f"{x} {y} 0"))
        link = re.search(rf'<link name="pin_{side}">.*?</link>', text, re.DOTALL)
        assert link is not None
        raised = re.sub(
            r'<origin xyz="(\S+) (\S+) (\S+)"',
            lambda m, up=float(z): f'<origin xyz="{m[1]} {m[2]} {float(m[3]) + up}"',
            link[0],
        )
        text = text.replace(link[0], raised)
    assert drawn(text).pin_height == UNIT.pin_height


def test_tags_on_a_side_of_a_port_may_be_numbered(drawn: Drawn) -> None:
    """Two of a side were taken for mistaken names of the usual one."""
    text = UNIT.urdf.read_text()
    for side in ("left", "right"):
        text = text.replace(f"port_rear_marker_{side}", f"port_rear_marker_{side}1")
        text = text.replace(
            "</robot>",
            f'<link name="port_rear_marker_{side}2"/><joint name="{side}2" type="fixed">'
            f'<parent link="port_rear_marker_{side}1"/><child link="port_rear_marker_{side}2"/>'
            '<origin xyz="0 -0.14 0"/></joint></robot>',
        )
    path = Path(UNIT.urdf)
    with pytest.raises(SceneError, match="left"):  # a single one is a mistake
        drawn(path.read_text().replace("port_rear_marker_left", "port_rear_marker_left1"))
    assert len(drawn(text).marker_slots("rear")) == 5


def test_only_the_tag_on_the_mast_of_a_port_is_as_small_as_that() -> None:
    tags = TagsSpec()
    assert tags.size("port_rear_marker_middle") == tags.mast_m
    assert tags.size("port_rear_marker_upper_middle") == tags.side_m
    assert tags.size("port_rear_marker_left") == tags.side_m


@pytest.mark.parametrize("roll", [0.0, 0.19, math.pi / 2])
def test_casters_that_lift_the_wheels_are_found_however_their_shapes_are_turned(
    drawn: Drawn, roll: float
) -> None:
    text = UNIT.urdf.read_text()
    for name in ("caster_front", "caster_rear"):
        link = re.search(rf'<link name="{name}">.*?</link>', text, re.DOTALL)
        assert link is not None
        turned = re.sub(
            r'<collision><origin xyz="0 0 0"/>',
            f'<collision><origin xyz="0 0 0" rpy="{roll} 0 0"/>',
            link[0],
        )
        text = text.replace(link[0], turned)
    drawn(text)
    low = text.replace('xyz="0.065 0 0.012"', 'xyz="0.065 0 0.0119"')
    low = low.replace('xyz="-0.065 0 0.012"', 'xyz="-0.065 0 0.0119"')
    assert low.count("0.0119") == 2
    with pytest.raises(SceneError, match=r"keep the wheels 0\.1 mm above the floor"):
        drawn(low)


def test_a_shape_that_reaches_up_to_the_overhead_camera_is_named(drawn: Drawn) -> None:
    """Only the frames of the robot were compared with the height of the camera."""
    text = UNIT.urdf.read_text()
    antenna = _link("antenna", '<box size="0.01 0.01 3.2"/>', "base", "0 0 1.65")
    inertial = re.search(r"<inertial>.*?</inertial>", text[text.index("port_rear_hole_left") :], re.DOTALL)
    assert inertial is not None
    antenna = antenna.replace('<link name="antenna">', f'<link name="antenna">{inertial[0]}')
    path = drawn(text).urdf
    path.write_text(text.replace("</robot>", antenna))
    tall = {"units.a.urdf": str(path), "units.b.urdf": str(path)}
    with pytest.raises(SceneError, match="reaches up to the overhead camera"):
        load_scene("two_units", tall)


def test_units_that_a_base_station_leads_dock_with_their_port_front(tmp_path: Path) -> None:
    """A step that named another active port was carried out with that one."""
    text = UNIT.urdf.read_text()
    nose = _link("port_nose", '<box size="0.001 0.001 0.001"/>', "port_front", "0 0 0", collides=False)
    path = tmp_path / "nosed.urdf"
    path.write_text(text.replace("</robot>", nose))
    nosed = {"units.a.urdf": str(path), "units.b.urdf": str(path), "plan.0.port": "nose"}
    assert load_scene("two_units", nosed).docks[0].port == "nose"
    with pytest.raises(
        SceneError, match=r"plan\.0\.port: units that a base station leads dock with .* 'nose'"
    ):
        load_scene("two_units", {**nosed, "radio": {}})
