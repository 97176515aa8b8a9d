"""Checks of the shapes of a robot: what PyBullet cannot read, and what is drawn in another unit, is named."""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import load_scene

ROUND = find_urdf("round.urdf")


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        ("", "a <visual> without a shape"),
        ('<box size="0.1 0.1"/>', "a <box> needs a size of three edges above 0, found '0.1 0.1'"),
        ('<cylinder radius="-0.1" length="1"/>', "a <cylinder> needs a radius and length above 0"),
        ('<sphere radius="0,1"/>', "a <sphere> needs a radius above 0, found '0,1'"),
        ('<ellipsoid size="1 1 1"/>', "unsupported shape <ellipsoid>"),
        (
            '<capsule radius="x" length="0.1"/>',
            "a <capsule> needs a radius and length above 0, found 'x 0.1'",
        ),
        ('<capsule radius="0.1"/>', "a <capsule> needs a radius and length above 0, found '0.1'"),
        ('<mesh filename="no.stl"/>', "no.stl; there is no such file"),
        ('<mesh filename="hood.dae"/>', "hood.dae; convert it"),
        ("<mesh/>", "a <mesh> without a file; name one by filename="),
        ('<mesh filename="hood.STL" scale="1 0 1"/>', "a <mesh> needs a scale of three numbers other than 0"),
    ],
)
def test_a_visual_shape_that_cannot_be_drawn_is_named_with_its_link(
    shape: str, says: str, tmp_path: Path
) -> None:
    """PyBullet ended the process on the mesh that is no OBJ or STL file."""
    (tmp_path / "hood.dae").write_text("<COLLADA/>")
    (tmp_path / "hood.STL").write_text("solid\nendsolid\n")
    visual = f"<visual><geometry>{shape}</geometry></visual>"
    text = ROUND.read_text().replace('<link name="lid_link">', f'<link name="lid_link">{visual}')
    (tmp_path / "drawn.urdf").write_text(text)
    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", {"units.a.urdf": str(tmp_path / "drawn.urdf")})
    assert "units.a.urdf: drawn.urdf: link 'lid_link': " in str(caught.value)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("mesh", "holder", "data", "says"),
    [
        ("hood.obj", "visual", "f 1 2 3\n", "no vertices"),
        ("hood.obj", "visual", "v 0 0\nv 1 0\nv 0 1\n", "a point in it is not three finite numbers"),
        ("hood.obj", "visual", "v 0 0 0\nv 1 0 nan\nv 0 1 0\n", "a point in it is not three finite"),
        ("hood.obj", "collision", "v 0 0\nv 1 0\nv 0 1\n", "a point in it is not three finite numbers"),
        ("hood.obj", "collision", "v 0 0 0\nv 1 0\nv 0 1 0\n", "a point in it is not three finite"),
        ("hood.obj", "collision", "v 0 0 0\nv 1 1 0\nv 1 1 1\nf 1 2 3\n", "is a line seen from above"),
        ("hood.stl", "visual", "solid\nendsolid\n", "no triangles"),
        ("hood.stl", "visual", 3 * "vertex 0 0 0\n", "of text, which PyBullet does not draw; write it as"),
    ],
)
def test_a_mesh_of_no_use_is_named(mesh: str, holder: str, data: str, says: str, tmp_path: Path) -> None:
    (tmp_path / mesh).write_text(data)
    part = f'<{holder}><geometry><mesh filename="{mesh}"/></geometry></{holder}>'
    (tmp_path / "drawn.urdf").write_text(ROUND.read_text().replace('"base_link">', f'"base_link">{part}', 1))
    with pytest.raises(SceneError, match=rf"units\.a\.urdf: .*{re.escape(mesh)}:? .*{says}"):
        load_scene("round_robots", {"units.a.urdf": str(tmp_path / "drawn.urdf")})


@pytest.mark.parametrize(
    ("link", "holder", "drawn", "says"),
    [
        ("lid_link", "visual", '<mesh filename="hood.stl"/>', "the <visual> hood.stl is 240 m long"),
        ("lid_link", "visual", '<mesh filename="hood.obj"/>', "the <visual> hood.obj is 240 m long"),
        ("base_link", "collision", '<mesh filename="hood.obj"/>', "the <collision> hood.obj is 240 m"),
        ("base_link", "collision", '<sphere radius="60"/>', "the <collision> <sphere> is 120 m long"),
    ],
)
def test_a_shape_drawn_in_millimetres_is_named_with_its_link(
    link: str, holder: str, drawn: str, says: str, tmp_path: Path
) -> None:
    """A hood of 240 mm. Nothing that is larger than the arena, 5 m across, can be in it."""
    corners = ("0 0 0", "240 0 0", "0 100 0")
    numbers = [float(x) for corner in corners for x in corner.split()]
    (tmp_path / "hood.stl").write_bytes(bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, *numbers, 0))
    (tmp_path / "hood.obj").write_text("".join(f"v {corner}\n" for corner in corners) + "f 1 2 3\n")

    def overrides(name: str, shape: str) -> Mapping[str, str]:
        part = f"<{holder}><geometry>{shape}</geometry></{holder}>"
        (tmp_path / name).write_text(ROUND.read_text().replace(f'"{link}">', f'"{link}">{part}', 1))
        return {"units.a.urdf": str(tmp_path / name)}

    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", overrides("drawn.urdf", drawn))
    assert f"units.a.urdf: drawn.urdf: link '{link}': {says}" in str(caught.value)
    assert "the whole arena is 5 m across" in str(caught.value)
    if "mesh" in drawn:
        assert 'needs scale="0.001 0.001 0.001", found none' in str(caught.value)
    if holder == "visual":
        load_scene("round_robots", overrides("scaled.urdf", drawn.replace("/>", ' scale="1e-3 1e-3 1e-3"/>')))


@pytest.mark.parametrize(
    ("link", "part", "says"),
    [
        (
            "caster_rear",
            '<lateral_friction value="zero"/>',
            "<contact>: the value of <lateral_friction> has to",
        ),
        ("caster_rear", '<lateral_friction value="-1"/>', "needs a value of 0 or above, found -1"),
        ("caster_rear", "<lateral_friction/>", "<lateral_friction> needs a value of 0 or above, found none"),
        (
            "caster_rear",
            '<rolling_friction value="nan"/>',
            "the value of <rolling_friction> has to be a number",
        ),
        (
            "left_wheel_link",
            '<lateral_friction value="0"/>',
            "is a wheel without friction, so that it slips; ",
        ),
    ],
)
def test_a_contact_of_no_use_is_named_with_its_link(link: str, part: str, says: str, tmp_path: Path) -> None:
    """PyBullet took the word to be 0."""
    tree = ElementTree.parse(ROUND)
    contact = tree.getroot().find(f"link[@name='{link}']/contact")
    assert contact is not None
    contact[:] = [ElementTree.fromstring(part)]
    tree.write(tmp_path / "contact.urdf")
    with pytest.raises(
        SceneError, match=rf"units\.a\.urdf: contact\.urdf: link '{link}'.* {re.escape(says)}"
    ):
        load_scene("round_robots", {"units.a.urdf": str(tmp_path / "contact.urdf")})


@pytest.mark.parametrize(
    ("link", "part"),
    [
        ("caster_rear", '<lateral_friction value="0"/>'),
        ("left_wheel_link", '<lateral_friction value="0.5"/>'),
        ("left_wheel_link", '<rolling_friction value="0"/>'),
        ("left_wheel_link", '<made_of value="rubber"/>'),
    ],
)
def test_a_contact_of_use_is_accepted(link: str, part: str, tmp_path: Path) -> None:
    """A caster may slide, a wheel may roll without friction; what PyBullet does not read is not checked."""
    tree = ElementTree.parse(ROUND)
    contact = tree.getroot().find(f"link[@name='{link}']/contact")
    assert contact is not None
    contact[:] = [ElementTree.fromstring(part)]
    tree.write(tmp_path / "contact.urdf")
    load_scene("round_robots", {"units.a.urdf": str(tmp_path / "contact.urdf")})
