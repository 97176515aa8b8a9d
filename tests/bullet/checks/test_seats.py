"""Robots that do not fit together when they are docked are refused before a trial."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from msrr_bullet.trial.check import check_trial
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf, read_unit
from msrr_scenes.loading.load import load_scene


def _with_boxes(folder: Path, *boxes: tuple[str, str]) -> str:
    """The shipped robot with further boxes on its body, each of an origin and a size [m]."""
    text = find_urdf("unit.urdf").read_text()
    added = "".join(
        f'<collision><origin xyz="{origin}"/><geometry><box size="{size}"/></geometry></collision>'
        for origin, size in boxes
    )
    end = text.index("</link>", text.index('<link name="body"'))
    own = folder / f"{len(list(folder.iterdir()))}.urdf"
    own.write_text(text[:end] + added + text[end:])
    return str(own)


def _with_bar(folder: Path, ahead_m: float) -> str:
    """The shipped robot with a bar across its front, above the pins, which ends ahead of the face."""
    x = read_unit(find_urdf("unit.urdf")).port("front").x + ahead_m - 0.01
    return _with_boxes(folder, (f"{x} 0 0.1", "0.02 0.06 0.006"))


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


@pytest.mark.parametrize("top_mm", [121, 129])
def test_what_bars_the_way_to_a_seat_that_is_free_is_named(tmp_path: Path, top_mm: int) -> None:
    """A hook ahead of the docking robot, 122 mm up and higher, has to pass a post that ends at ``top_mm``."""
    front = read_unit(find_urdf("unit.urdf")).port("front").x
    rear = read_unit(find_urdf("unit.urdf")).port("rear").x
    arm = (f"{front - 0.01} 0 0.135", "0.12 0.02 0.006")
    hook = (f"{front + 0.045} 0 0.128", "0.01 0.02 0.012")  # its tip is 50 mm ahead of the face
    top = 1e-3 * top_mm
    post = (f"{rear + 0.02} 0 {0.5 * (0.09 + top)}", f"0.01 0.02 {top - 0.09}")
    scene = load_scene(
        "close_range",
        {"units.a.urdf": _with_boxes(tmp_path, arm, hook), "units.b.urdf": _with_boxes(tmp_path, post)},
    )
    if top < 0.122:
        check_trial(scene)
        return
    with pytest.raises(
        SceneError, match=r"a at b\.rear: (\d+) mm before the seat they would overlap"
    ) as caught:
        check_trial(scene)
    found = re.search(r"(\d+) mm before", str(caught.value))
    assert found is not None
    assert 31 <= int(found[1]) <= 35  # the tip meets the post 15 mm behind the face, 35 mm before the seat
