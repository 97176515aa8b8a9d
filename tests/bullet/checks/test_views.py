"""A robot that does not see its port where it needs to is refused before a trial."""

from __future__ import annotations

from pathlib import Path

import pytest

from msrr_bullet.trial.check import check_trial
from msrr_scenes.errors import SceneError
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.loading.load import load_scene


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"cameras.onboard.height_px": 60}, "where it begins another attempt, 0.5"),
        ({"cameras.onboard.height_px": 150}, "in its seat, 0.10"),
        ({"units.a.frames": "{camera: {link: camera, pitch_deg: 30}}"}, "where its approach begins, 0.8"),
    ],
)
def test_a_camera_has_to_see_its_port_wherever_it_needs_to(changes: dict[str, object], where: str) -> None:
    with pytest.raises(SceneError, match=rf"camera of a has no tag of b\.rear .* {where}"):
        check_trial(load_scene("close_range", changes))


def test_no_tag_is_asked_for_in_a_seat_that_is_verified_by_the_switches_alone() -> None:
    check_trial(
        load_scene("close_range", {"cameras.onboard.height_px": 150, "docking.verify.by_sight": "false"})
    )


def _with_plate(folder: Path, x_m: float, y_m: float, width_m: float) -> str:
    """The shipped robot with an upright plate that is only seen."""
    return _with_box(folder, f"{x_m} {y_m} 0.155", f"0.004 {width_m} 0.16")


def _with_box(folder: Path, xyz: str, size: str) -> str:
    """The shipped robot with a box that is only seen."""
    text = find_urdf("unit.urdf").read_text()
    plate = f'<visual><origin xyz="{xyz}"/><geometry><box size="{size}"/></geometry></visual>'
    end = text.index("</link>", text.index('<link name="body"'))
    own = folder / f"{len(list(folder.iterdir()))}.urdf"
    own.write_text(text[:end] + plate + text[end:])
    return str(own)


@pytest.mark.parametrize("name", ["close_range", "three_units"])
@pytest.mark.parametrize(("x_m", "hider"), [(0.05, "a"), (-0.15, "b")])
def test_what_hides_every_tag_of_a_port_is_named(tmp_path: Path, name: str, x_m: float, hider: str) -> None:
    """A plate before the camera of the docking robot, or before the tags of the other one."""
    plate = {f"units.{hider}.urdf": _with_plate(tmp_path, x_m, 0.0, 0.2)}
    scene = load_scene(name, plate)
    where = rf"no tag of {scene.docks[0].target_unit} as a whole where its approach begins"
    left, right = (f"port_rear_marker_{side} behind {hider}" for side in ("left", "right"))
    with pytest.raises(SceneError, match=rf"{where}.*{left}, .*{right}[,)]"):
        check_trial(scene)
    check_trial(load_scene(name, {**plate, "perception": "parametric"}))


def test_a_port_of_which_one_tag_is_left_is_accepted(tmp_path: Path) -> None:
    plate = _with_plate(tmp_path, x_m=-0.15, y_m=0.06, width_m=0.1)
    check_trial(load_scene("close_range", {"units.b.urdf": plate}))


def test_a_robot_that_covers_its_own_tag_on_top_is_refused(tmp_path: Path) -> None:
    """By a plate 7 cm above the tag, which hides one row of its modules."""
    plate = {"units.b.urdf": _with_box(tmp_path, "0 -0.12 0.3", "0.15 0.15 0.004")}
    with pytest.raises(SceneError, match=r"units\.b\.urdf: .*covers its own tag tag_top"):
        check_trial(load_scene("two_units", plate))
    check_trial(load_scene("two_units", {**plate, "perception": "parametric"}))


def test_a_part_beside_the_tag_on_top_is_accepted(tmp_path: Path) -> None:
    plate = {"units.b.urdf": _with_box(tmp_path, "0 -0.13 0.3", "0.15 0.15 0.004")}
    check_trial(load_scene("two_units", plate))


def test_cameras_of_robots_that_build_a_shape_have_to_see_its_ports() -> None:
    up = {
        f"units.{unit}.frames": "{camera: {link: camera, pitch_deg: -40}}"
        for unit in load_scene("assemble_tee").units
    }
    with pytest.raises(SceneError, match=r"camera of \w has no tag of \w\.\w+ as a whole in its picture"):
        check_trial(load_scene("assemble_tee", up))
