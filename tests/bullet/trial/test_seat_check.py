"""Robots that do not fit together when they are docked are refused before a trial."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from msrr_bullet.trial.check import check_trial
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.loading.load import load_scene


def _with_bar(folder: Path, ahead_m: float) -> str:
    """The shipped robot with a bar across its front, above the pins, which ends ahead of the face."""
    urdf = find_urdf("unit.urdf")
    x = read_unit(urdf).port("front").x + ahead_m - 0.01
    box = (
        f'<collision><origin xyz="{x} 0 0.1"/><geometry><box size="0.02 0.06 0.006"/></geometry></collision>'
    )
    text = urdf.read_text()
    end = text.index("</link>", text.index('<link name="body"'))
    own = folder / "bar.urdf"
    own.write_text(text[:end] + box + text[end:])
    return str(own)


@pytest.mark.parametrize("ahead_mm", [-1.0, 1.0])
def test_what_fits_is_accepted(tmp_path: Path, ahead_mm: float) -> None:
    check_trial(load_scene("close_range", {"units.a.urdf": _with_bar(tmp_path, 1e-3 * ahead_mm)}))


def test_what_meets_the_target_in_the_seat_is_named_with_its_place(tmp_path: Path) -> None:
    scene = load_scene("close_range", {"units.a.urdf": _with_bar(tmp_path, 0.003)})
    with pytest.raises(SceneError) as caught:
        check_trial(scene)
    found = re.search(
        r"a at b\.rear: seated they would overlap by (\S+) mm, (\S+) mm behind", str(caught.value)
    )
    assert found is not None
    assert float(found[1]) == pytest.approx(3.0, abs=0.3)
    assert float(found[2]) == pytest.approx(0.0, abs=3.0)
    check_trial(scene.model_copy(update={"plant": "unicycle"}))
