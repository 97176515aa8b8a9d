"""True errors without an effect are refused; those of a grade are not."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import check_scene, load_scene, shipped_scenes
from msrr_scenes.specs.as_built import Grade
from tests.conftest import shipped_as_is


@pytest.mark.parametrize(
    ("key", "changes", "message"),
    [
        ("as_built.floor.ridge_m", {"plant": "unicycle"}, "use plant bullet"),
        ("as_built.body.mass_percent", {"plant": "unicycle"}, "use plant bullet"),
        ("as_built.overhead.yaw_deg", {}, "no overhead camera"),
    ],
)
def test_an_error_without_an_effect_is_refused(key: str, changes: dict[str, str], message: str) -> None:
    with pytest.raises(SceneError, match=message) as refused:
        load_scene("close_range", {**changes, key: "0.002"})
    assert f"override {key}=0.002: {key}: " in str(refused.value)
    load_scene("close_range", {**changes, key: "0"})
    load_scene("close_range", {**changes, key: "{sigma: 0.002}"})


def test_an_error_with_an_effect_is_accepted() -> None:
    """Bullet has a floor and masses, the unicycle has neither; only one of the scenes has a camera above."""
    of_robots = {"as_built.onboard.yaw_deg": "1", "as_built.body.switch_travel_m": "0.001"}
    load_scene("close_range", {"plant": "unicycle", **of_robots})
    load_scene("close_range", {"as_built.floor.ridge_m": "0.002", "as_built.body.mass_percent": "5"})
    load_scene("two_units", {"plant": "unicycle", "as_built.overhead.yaw_deg": "1"})


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
@pytest.mark.parametrize("perception", ["images", "parametric"])
def test_a_grade_goes_with_every_plant_and_perception(plant: str, perception: str) -> None:
    scene = load_scene("two_units", {"as_built": "rough", "plant": plant, "perception": perception})
    assert str(scene.as_built) == "rough"


def test_shipped_robots_are_built_with_care_unless_a_scene_provokes_a_failure_in_front_of_a_port() -> None:
    """The rule of the page, by the outcomes that it lists; and each scene goes with the other grade."""
    page = (Path(__file__).parents[3] / "docs" / "reference" / "scenes.md").read_text()
    outcomes = dict(re.findall(r"^\| `(\w+)` \| .* \| (\w+)[^|]*\|$", page, re.MULTILINE))
    for name in shipped_scenes():
        usual: Grade = "careful"
        other: Grade = "perfect"
        succeeds = outcomes[name] in ("docked", "complete", "incomplete", "blocked")
        if not succeeds:
            usual, other = other, usual
        scene = shipped_as_is(name)
        assert str(scene.as_built) == usual, name
        check_scene(scene.at_grade(other))
