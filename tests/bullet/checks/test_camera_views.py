"""What ``msrr check`` says of cameras that show tags too small."""

from __future__ import annotations

import pytest

from msrr_bullet.checks.camera_views import coarse_tags
from msrr_bullet.run import run_trial
from msrr_bullet.trial.result import Outcome
from msrr_scenes.loading.load import load_scene, shipped_scenes
from tests.conftest import shipped_as_is


def _camera(name: str, width_px: int) -> dict[str, object]:
    return {f"cameras.{name}.width_px": width_px, f"cameras.{name}.height_px": width_px * 3 // 4}


def test_the_cameras_of_shipped_scenes_show_their_tags_large_enough() -> None:
    for name in shipped_scenes():
        assert not list(coarse_tags(shipped_as_is(name)))


def test_the_tag_of_an_obstacle_is_too_small_before_those_of_units_are() -> None:
    [line] = coarse_tags(load_scene("two_units", _camera("overhead", 400)))
    assert line.startswith("cameras.overhead: tags on top (post) are 10.8 px wide, 1.35 px per module")
    [line] = coarse_tags(load_scene("two_units", _camera("overhead", 300)))
    assert "(b, a, post) are 8.1 px wide" in line


@pytest.mark.parametrize("name", ["close_range", "two_units"])
def test_an_onboard_camera_is_asked_where_the_approach_begins(name: str) -> None:
    assert not list(coarse_tags(load_scene(name, _camera("onboard", 320))))
    [line] = coarse_tags(load_scene(name, _camera("onboard", 160)))
    assert line.startswith(
        "cameras.onboard: 0.80 m from b.rear, where a begins its approach, tags are 6.4 px"
    )


def test_nothing_is_asked_where_an_assembler_of_a_users_own_ends() -> None:
    """The start was taken for that place: 2.6 m away in this scene, and facing anywhere."""
    own = {**_camera("onboard", 160), "control.assembly": "my_lab:Assembler"}
    assert not list(coarse_tags(load_scene("two_units", own)))
    [line] = coarse_tags(load_scene("close_range", _camera("onboard", 160)))
    assert "0.80 m from b.rear" in line


def test_parametric_cameras_show_no_pixels() -> None:
    scene = load_scene("two_units", {**_camera("overhead", 300), "perception": "parametric"})
    assert not list(coarse_tags(scene))


def test_an_obstacle_is_found_from_above_with_tags_of_1_6_px_per_module() -> None:
    """Its tag was looked for at half the resolution, never found, and the unit drove into it."""
    result = run_trial(load_scene("two_units", _camera("overhead", 480)), 0)
    assert result.outcome is Outcome.DOCKED
    assert result.min_clearance_m > 0.03
