"""True errors without an effect are refused; those of a grade are not."""

from __future__ import annotations

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene, shipped_scenes


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
    assert f"--set {key}=0.002: {key}: " in str(refused.value)
    load_scene("close_range", {**changes, key: "0"})
    load_scene("close_range", {**changes, key: "{sigma: 0.002}"})


@pytest.mark.parametrize("plant", ["bullet", "unicycle"])
@pytest.mark.parametrize("perception", ["images", "parametric"])
def test_a_grade_goes_with_every_plant_and_perception(plant: str, perception: str) -> None:
    scene = load_scene("two_units", {"as_built": "rough", "plant": plant, "perception": perception})
    assert str(scene.as_built) == "rough"


def test_a_grade_goes_with_every_shipped_scene() -> None:
    for name in shipped_scenes():
        assert load_scene(name, {"as_built": "careful"}).as_built.grade == "careful"
