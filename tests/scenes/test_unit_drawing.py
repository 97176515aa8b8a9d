import re
from functools import cache
from pathlib import Path

import pytest

from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit, urdf_folder
from tests.conftest import load_script


@pytest.fixture(scope="module")
def draw_unit():
    """The program, which measures the holes once for all tests."""
    script = load_script(urdf_folder() / "draw_unit.py")
    script.hole_widths = cache(script.hole_widths)
    return script


def labels(path: Path) -> list[str]:
    return sorted(re.findall(r">([^<>]+)</text>", path.read_text()))


def test_holes_are_measured_on_the_shapes(draw_unit):
    mouth, throat, depth, narrow = draw_unit.hole_widths(read_unit(find_urdf("unit.urdf")))
    assert (mouth, throat, depth, narrow) == pytest.approx((0.040, 0.016, 0.0185, 0.013), abs=3e-4)


def test_the_drawing_in_the_readme_is_that_of_the_urdf(draw_unit, tmp_path, monkeypatch):
    out = tmp_path / "unit.svg"
    monkeypatch.setattr("sys.argv", ["draw_unit.py", str(out)])
    draw_unit.main()
    shipped = labels(urdf_folder() / "unit.svg")
    assert shipped == labels(out), "the URDF has changed: run python urdf/draw_unit.py"
    assert {"l = 100", "mouth 40", "track 130"} <= set(shipped)
