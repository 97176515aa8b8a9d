"""Checks of a port against the port that it docks to: what could not dock is named before a trial."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import load_scene

PORT = "units.a.frames.port_front"


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        ({"y_m": "0.02"}, "port_front is 20.0 mm beside the x axis of the frame axle and turned by 0.0 deg"),
        (
            {"yaw_deg": "-5"},
            "port_front is 0.0 mm beside the x axis of the frame axle and turned by -5.0 deg",
        ),
        ({"x_m": "0.12"}, "pin_left ends 9.5 mm behind the bottom of its hole when port_front and port_rear"),
        ({"x_m": "0.14"}, "pin_left ends 10.5 mm short of the bottom of its hole"),
    ],
)
def test_a_port_that_does_not_belong_to_its_face_is_named(overrides: Mapping[str, str], says: str) -> None:
    """Robots with the first two docked, and were judged as false docks; the others never did."""
    with pytest.raises(SceneError) as caught:
        load_scene("round_robots", {f"{PORT}.{key}": value for key, value in overrides.items()})
    assert f"{PORT}: round.urdf: " in str(caught.value)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("pin", "says"),
    [
        ("0.13 0.05 0.07", "to dock to b.rear: pin_left is 10.0 mm too far to the left for its hole"),
        ("0.13 0.04 0.06", "pin_left is 10.0 mm too low for its hole"),
        ("0.13 0.04 0.085", "pin_left is 15.0 mm too high for its hole"),
        ("0.13 0.04 0.0736", "pin_left is 3.6 mm too high for its hole"),
        ("0.13 0.0431 0.07", "are 3.1 mm farther apart than their holes, which leave 3.0 mm"),
        ("0.13 0.0368 0.07", "are 3.2 mm nearer to each other than their holes, which leave 3.0 mm"),
    ],
)
def test_a_pin_that_misses_its_hole_is_named(pin: str, says: str, tmp_path: Path) -> None:
    text = find_urdf("round.urdf").read_text()
    assert "0.13 0.04 0.07" in text
    (tmp_path / "other.urdf").write_text(text.replace("0.13 0.04 0.07", pin))
    other = {"units.a.urdf": str(tmp_path / "other.urdf")}
    with pytest.raises(SceneError, match=re.escape(says)):
        load_scene("round_robots", other)
    load_scene("round_robots", {**other, "plant": "unicycle"})  # has no contact, and no pins that miss


@pytest.mark.parametrize("pin", ["0.13 0.04 0.0734", "0.13 0.0429 0.07"])
def test_a_pin_that_just_fits_is_taken(pin: str, tmp_path: Path) -> None:
    """The holes leave 3.5 mm above the pins and 1.5 mm beside them; robots with these docked."""
    text = find_urdf("round.urdf").read_text()
    (tmp_path / "other.urdf").write_text(text.replace("0.13 0.04 0.07", pin))
    load_scene("round_robots", {"units.a.urdf": str(tmp_path / "other.urdf")})


@pytest.mark.parametrize(("width", "says"), [("0.02", "4.0 mm too narrow for"), ("0.016", "no wider than")])
def test_pins_that_are_too_thick_for_the_holes_are_named(width: str, says: str, tmp_path: Path) -> None:
    """Pins of 20 mm or of 16 mm in throats of 16 mm; the tips pass the mouths."""
    text = find_urdf("round.urdf").read_text()
    assert text.count('"0.019 0.013 0.013"') == 4
    (tmp_path / "thick.urdf").write_text(text.replace('"0.019 0.013 0.013"', f'"0.019 {width} 0.013"'))
    with pytest.raises(SceneError, match=rf"the holes of port_rear of round\.urdf are {says} the pins"):
        load_scene("round_robots", {"units.a.urdf": str(tmp_path / "thick.urdf")})


def test_units_of_a_shape_have_to_fit_each_other(tmp_path: Path) -> None:
    text = find_urdf("unit.urdf").read_text()
    (tmp_path / "wide.urdf").write_text(re.sub(r'"(\S+) 0\.04 0\.085"', r'"\1 0.05 0.085"', text))
    name = next(iter(load_scene("assemble_tee").units))
    says = rf"units\.{name}\.urdf: wide\.urdf: .* pin_left is 10\.0 mm too far to the left for its hole"
    with pytest.raises(SceneError, match=says):
        load_scene("assemble_tee", {f"units.{name}.urdf": str(tmp_path / "wide.urdf")})
