"""Pins and holes, measured on the shapes of a URDF: what passes the mouth, and how much play is left."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from msrr_scenes.errors import GeometryError
from msrr_scenes.geometry.pin_and_hole import PinAndHole
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3, rotation_from_rpy
from msrr_scenes.geometry.solid import Solid
from msrr_scenes.geometry.unit_geometry import UnitGeometry, find_urdf, read_unit

UNIT = read_unit(find_urdf("unit.urdf"))
#: Height of pins and holes [m].
Z = 0.085
LENGTH = 0.02


def box(link: str, X: SE3, *size: float) -> Solid:
    return Solid(link, "box", X, size)


def at(x: float, y: float, yaw: float = 0.0, roll: float = 0.0, z: float = Z) -> SE3:
    return SE3(rotation_from_rpy(roll, 0.0, yaw), np.array([x, y, z]))


def with_pins(*pins: Solid) -> UnitGeometry:
    """Return a unit whose front port is 0.1 m ahead, with pins that are drawn from its face on."""
    X_UP = SE3.from_se2(SE2(0.1, 0.0, 0.0))
    solids = tuple(replace(pin, X_UG=X_UP @ pin.X_UG) for pin in pins)
    frames = {"port_front": X_UP, **{pin.link: X_UP @ pin.X_UG for pin in pins}}
    return UnitGeometry(Path("pins.urdf"), frames, solids, 0.03, 0.16)


def with_hole(*walls: Solid, X_UD: SE2 | None = None, middle: float = 0.0) -> UnitGeometry:
    """Return a unit with one hole, drawn in the dock frame of its rear port, which lies anywhere on it."""
    X_UD = X_UD or SE2(-0.1, 0.0, 0.0)
    X = SE3.from_se2(X_UD)
    solids = tuple(replace(wall, link="body", X_UG=X @ wall.X_UG) for wall in walls)
    end = box("port_rear_hole_left", X @ at(LENGTH + 0.001, middle), 0.002, 0.01, 0.03)
    frames = {"port_rear": SE3.from_se2(X_UD @ SE2(0.0, 0.0, math.pi)), end.link: end.X_UG}
    return UnitGeometry(Path("hole.urdf"), frames, (*solids, end), 0.03, 0.16)


def measured(unit: UnitGeometry, target: UnitGeometry) -> tuple[float, float]:
    found = PinAndHole.of(unit, "front", target, "rear")
    return found.mouth, found.play


def test_the_shipped_unit_tolerates_what_its_drawing_says() -> None:
    """Tips of 10 mm in mouths of 40 mm, pins of 13 mm in throats of 16 mm; 18 mm long, 80 mm apart."""
    for port in UNIT.passive_ports:
        found = PinAndHole.of(UNIT, "front", UNIT, port)
        assert (found.mouth, found.play, found.pins) == (0.015, 0.0015, (0.04, -0.04))
        assert found.pin_length == pytest.approx(0.018, abs=1e-6)


PIN = box("pin_left", at(0.5 * LENGTH, 0.0), LENGTH, 0.012, 0.01)
LENGTHS = st.floats(0.001, 0.03)


@given(gap=LENGTHS, side=st.floats(-0.04, 0.04), x=st.floats(-0.3, 0.3), yaw=st.floats(-3.1, 3.1))
def test_a_straight_hole_has_half_of_what_it_is_wider_to_each_side(
    gap: float, side: float, x: float, yaw: float
) -> None:
    """Wherever the port lies on its unit, and the hole beside its axis."""
    walls = [
        box("body", at(0.02, side + sign * (0.5 * (0.012 + gap) + 0.01)), 0.04, 0.02, 0.03)
        for sign in (-1, 1)
    ]
    target = with_hole(*walls, X_UD=SE2(x, -x, yaw), middle=side)
    assert measured(with_pins(PIN), target) == pytest.approx((0.5 * gap, 0.5 * gap), abs=2e-6)


@given(slope=st.floats(0.1, 1.2), throat=LENGTHS)
def test_a_funnel_is_as_wide_at_its_mouth_as_its_slope_makes_it(slope: float, throat: float) -> None:
    """Plates from the corners of the throat, 10 mm deep, outwards to the face; they go on beyond it."""
    walls = []
    for sign in (-1.0, 1.0):
        corner = np.array([0.01, sign * (0.006 + throat)])
        along = np.array([-math.cos(slope), sign * math.sin(slope)])
        out = np.array([math.sin(slope), sign * math.cos(slope)])
        x, y = corner + 0.025 * along + 0.002 * out
        walls += [
            box("body", at(float(x), float(y), math.atan2(along[1], along[0])), 0.05, 0.004, 0.03),
            box("body", at(0.02, sign * (0.016 + throat)), 0.02, 0.02, 0.03),
        ]
    wide = throat + 0.01 * math.tan(slope)
    assert measured(with_pins(PIN), with_hole(*walls)) == pytest.approx((wide, throat), abs=2e-6)


def test_what_lies_above_or_below_the_pins_is_no_wall() -> None:
    walls = [box("body", at(0.02, sign * 0.02), 0.04, 0.02, 0.03) for sign in (-1, 1)]
    lid = box("body", at(0.02, 0.0, z=Z + 0.02), 0.04, 0.2, 0.01)
    assert measured(with_pins(PIN), with_hole(*walls, lid)) == (0.004, 0.004)
    low = box("body", at(0.02, 0.0, z=Z + 0.004), 0.04, 0.2, 0.01)  # reaches down to the middle of the pins
    assert measured(with_pins(PIN), with_hole(*walls, low))[0] < 0.0


def test_a_slanted_wall_counts_where_the_pin_is() -> None:
    """A plate that leans to the hole by 45 degrees is sqrt(2) times its thickness wide at every height."""
    walls = [box("body", at(0.02, sign * 0.02, roll=math.pi / 4.0), 0.04, 0.004, 0.08) for sign in (-1, 1)]
    room = 0.02 - 0.002 * math.sqrt(2.0) - 0.006
    assert measured(with_pins(PIN), with_hole(*walls)) == pytest.approx((room, room), abs=2e-6)


def test_round_pins_and_pins_from_a_mesh_are_as_wide_as_they_are(tmp_path: Path) -> None:
    walls = [box("body", at(0.02, sign * 0.02), 0.04, 0.02, 0.03) for sign in (-1, 1)]
    X = SE3(rotation_from_rpy(0.0, math.pi / 2.0, 0.0), np.array([0.5 * LENGTH, 0.0, Z]))
    rod = Solid("pin_left", "cylinder", X, (0.005, LENGTH))
    assert measured(with_pins(rod), with_hole(*walls)) == pytest.approx((0.005, 0.005), abs=1e-4)
    rng = np.random.default_rng(4)
    corners = 0.5 * np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    points = np.concatenate([corners, rng.uniform(-0.5, 0.5, (400, 3))]) * PIN.size
    mesh = tmp_path / "pin.obj"
    mesh.write_text("".join(f"v {x:.9f} {y:.9f} {z:.9f}\n" for x, y, z in points))
    drawn = Solid("pin_left", "mesh", PIN.X_UG, (1.0, 1.0, 1.0), mesh)
    found = PinAndHole.of(with_pins(drawn), "front", with_hole(*walls), "rear")
    assert (found.mouth, found.play) == (0.004, 0.004)
    assert found.pin_length == pytest.approx(LENGTH, abs=1e-8)


@pytest.mark.parametrize("thick_first", [False, True])
def test_a_pin_that_is_shorter_than_another_one_passes_the_mouth_by_its_own_tip(thick_first: bool) -> None:
    """15 mm long and 20 mm wide in a hole of 20 mm, beside one of 20 mm and 12 mm."""
    walls = [box("body", at(0.02, sign * 0.02), 0.04, 0.02, 0.03) for sign in (-1, 1)]
    thick = box("pin_right", at(0.0075, 0.0), 0.015, 0.02, 0.01)
    pins = (thick, PIN) if thick_first else (PIN, thick)
    assert measured(with_pins(*pins), with_hole(*walls)) == (0.0, 0.0)


def test_a_tip_above_the_middle_of_a_pin_does_not_hide_the_pin() -> None:
    walls = [box("body", at(0.02, sign * 0.02), 0.04, 0.02, 0.03) for sign in (-1, 1)]
    tip = box("pin_left", at(LENGTH + 0.004, 0.0, z=Z + 0.01), 0.01, 0.004, 0.004)
    assert measured(with_pins(PIN, tip), with_hole(*walls)) == (0.004, 0.004)


@pytest.mark.parametrize("count", [4, 400])
@pytest.mark.parametrize("across", [False, True])
def test_a_flat_mesh_is_a_wall(tmp_path: Path, count: int, across: bool) -> None:
    """Sheets along both sides of a hole, or one across it, of a few points or of many."""
    edges = [[0.0, -0.02], [0.04, -0.02], [0.04, 0.02], [0.0, 0.02]]
    inside = np.random.default_rng(2).uniform([0.0, -0.02], [0.04, 0.02], (count - 4, 2))
    along, up = np.concatenate([edges, inside]).T
    (tmp_path / "sheet.obj").write_text("".join(f"v {x} 0 {z}\n" for x, z in zip(along, up, strict=True)))

    def sheet(X: SE3) -> Solid:
        return Solid("body", "mesh", X, (1.0, 1.0, 1.0), tmp_path / "sheet.obj")

    walls = [sheet(at(0.0, sign * 0.01)) for sign in (-1, 1)]
    if across:
        walls = [sheet(at(0.01, -0.02, yaw=0.5 * math.pi))]
    room = -0.026 if across else 0.004
    assert measured(with_pins(PIN), with_hole(*walls)) == pytest.approx((room, room), abs=1e-6)


@pytest.mark.parametrize("touch_m", [1e-4, 1e-7, 1e-12])
def test_a_ball_that_touches_the_middle_of_the_pins_is_in_their_way(touch_m: float) -> None:
    ball = Solid("body", "sphere", at(0.01, 0.0, z=Z - 0.01 + touch_m), (0.01,))
    assert measured(with_pins(PIN), with_hole(ball))[1] <= -0.006


def test_without_drawn_holes_it_is_the_shipped_mechanism_and_without_pins_none() -> None:
    assert measured(with_pins(PIN), with_hole()) == (0.015, 0.0015)
    with pytest.raises(GeometryError, match="a unit docks by pins"):
        PinAndHole.of(with_pins(), "front", UNIT, "rear")
