import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit, tag_corners

SIDE_TAG, MAST_TAG = 0.05, 0.04
UNIT = read_unit(find_urdf("unit.urdf"))


def in_dock(port, link):
    """X_DF: a link seen from the dock frame of a port."""
    return SE3.from_se2(UNIT.dock_frame(port)).inverse() @ UNIT.frame(link)


def test_drive_and_ports():
    assert UNIT.wheel_radius == 0.033
    assert UNIT.track == pytest.approx(0.13)
    assert UNIT.ports == ("front", "rear", "left", "right")
    assert UNIT.passive_ports == ("rear", "left", "right")
    assert UNIT.control_offset("front") == pytest.approx(0.10)
    for port, (x, y, yaw) in {
        "front": (0.1, 0, 0),
        "rear": (-0.1, 0, math.pi),
        "left": (0, 0.1, math.pi / 2),
        "right": (0, -0.1, -math.pi / 2),
    }.items():
        X_UP = UNIT.port(port)
        assert (X_UP.x, X_UP.y) == pytest.approx((x, y), abs=1e-9)
        assert abs(math.remainder(X_UP.yaw - yaw, 2 * math.pi)) < 1e-8


def test_footprint_is_a_square_with_cut_corners_and_two_pins():
    P = UNIT.footprint
    assert P[:, 0].max() == pytest.approx(0.118)
    assert P[:, 0].min() == pytest.approx(-0.1, abs=1e-6)
    assert np.abs(P[:, 1]).max() == pytest.approx(0.1, abs=1e-6)
    assert (np.abs(P).sum(axis=1)).max() <= 0.18 + 1e-6  # no corner
    assert UNIT.circumradius == pytest.approx(math.hypot(0.1, 0.08), abs=1e-6)


def test_camera_looks_level_and_ahead_from_the_axle():
    X_UC = UNIT.frame("camera")
    np.testing.assert_allclose(X_UC.p, [0, 0, 0.155], atol=1e-12)
    np.testing.assert_allclose(X_UC.R, np.eye(3), atol=1e-12)


def test_slots_are_in_the_order_of_the_tag_ids():
    assert UNIT.tag_slots[0] == "tag_top"
    assert [s.removeprefix("port_") for s in UNIT.tag_slots[1:4]] == [
        "rear_marker_left",
        "rear_marker_middle",
        "rear_marker_right",
    ]
    assert len(UNIT.tag_slots) == 10


@pytest.mark.parametrize("port", ["rear", "left", "right"])
def test_marker_stands_where_the_design_puts_it(port):
    at = {slot: in_dock(port, f"port_{port}_marker_{slot}") for slot in ("left", "middle", "right")}
    np.testing.assert_allclose(at["left"].p, [0.0281, 0.0249, 0.136], atol=1e-8)
    np.testing.assert_allclose(at["right"].p, [0.0281, -0.0249, 0.136], atol=1e-8)
    np.testing.assert_allclose(at["middle"].p, [0.0745, 0, 0.199], atol=1e-8)
    for slot, cant_deg in {"left": -40, "middle": 0, "right": 40}.items():
        R = at[slot].R
        cant = math.radians(cant_deg)
        np.testing.assert_allclose(R[:, 2], [math.cos(cant), math.sin(cant), 0], atol=1e-8)  # into the unit
        np.testing.assert_allclose(R[:, 1], [0, 0, -1], atol=1e-8)  # y down
        assert R[1, 0] < 0  # x to the right of who approaches: heading +x, right is -y
        assert np.linalg.det(R) == pytest.approx(1.0)


def test_markers_of_neighbouring_ports_leave_each_other_room():
    for port in UNIT.passive_ports:
        for slot in ("left", "right"):
            plate = in_dock(port, f"port_{port}_marker_{slot}").act(tag_corners(1.25 * SIDE_TAG))
            assert (np.abs(plate[:, 1]) + plate[:, 0]).max() <= 0.10


def test_nothing_of_the_unit_stands_in_the_cameras_view():
    half_fov = math.radians(37.5)
    for slot in UNIT.tag_slots[1:]:
        size = MAST_TAG if slot.endswith("middle") else SIDE_TAG
        x, y, _ = UNIT.frame(slot).act(tag_corners(1.25 * size)).T
        assert np.all((np.abs(np.arctan2(y, x)) > half_fov) | (x < 0))


def test_pins_meet_the_holes():
    for side, y in (("left", 0.04), ("right", -0.04)):
        np.testing.assert_allclose(UNIT.frame(f"pin_{side}").p, [0.1, y, 0.085], atol=1e-9)
        for port in UNIT.passive_ports:
            X_DH = in_dock(port, f"port_{port}_hole_{side}")
            np.testing.assert_allclose(X_DH.p[1:], [y, 0.085], atol=1e-8)
            assert 0.018 < X_DH.p[0] < 0.02


def test_a_unit_without_its_named_frames_is_refused_by_name(tmp_path: Path):
    text = find_urdf("unit.urdf").read_text()
    path = tmp_path / "blind.urdf"
    path.write_text(text.replace('"camera"', '"eye"'))
    with pytest.raises(GeometryError, match=r"lacks the link.*camera"):
        read_unit(path)
    with pytest.raises(GeometryError, match="no such URDF"):
        read_unit(tmp_path / "nothing.urdf")
    path = tmp_path / "broken.urdf"
    path.write_text(text[:2000])
    with pytest.raises(GeometryError, match="not well-formed"):
        read_unit(path)
    path.write_text('<?xml version="1.0" encoding="latin-nil"?><robot name="x"/>')
    with pytest.raises(GeometryError, match="not well-formed XML: unknown encoding"):
        read_unit(path)
    with pytest.raises(GeometryError, match="no link named 'tail'"):
        UNIT.frame("tail")


def test_a_file_that_was_written_anew_is_read_anew(tmp_path: Path) -> None:
    """A program that stays, such as a notebook or the page in the browser, had the older robot."""
    text, path, mesh = UNIT.urdf.read_text(), tmp_path / "unit.urdf", tmp_path / "pin.obj"
    pin = '<box size="0.019 0.013 0.013"/>'
    assert pin in text
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n")
    path.write_text(text.replace(pin, f'<mesh filename="{mesh.name}" scale="0.019 0.013 0.013"/>', 2))
    first = read_unit(path)
    assert read_unit(path) is first
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1.5\nf 1 2 3\nf 1 2 4\n")
    second = read_unit(path)
    assert second is not first
    highest = [max(s.points()[:, 2].max() for s in u.solids if s.mesh) for u in (first, second)]
    assert highest[1] == pytest.approx(0.085 + 1.5 * 0.013)
    path.write_text(text)
    assert not any(solid.mesh for solid in read_unit(path).solids)


def test_the_height_of_the_pins_is_that_of_their_middle():
    assert UNIT.pin_height == pytest.approx(0.085, abs=1e-9)
    without = replace(UNIT, solids=tuple(s for s in UNIT.solids if not s.link.startswith("pin_")))
    with pytest.raises(GeometryError, match="pin_"):
        _ = without.pin_height


@pytest.mark.parametrize("kind", ["revolute", "fixed"])
def test_a_wheel_that_does_not_turn_on_and_on_is_refused(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "stiff.urdf"
    path.write_text(UNIT.urdf.read_text().replace('type="continuous"', f'type="{kind}"', 1))
    with pytest.raises(GeometryError, match=rf"the joint of 'wheel_\w+' has to be continuous, found {kind}"):
        read_unit(path)
