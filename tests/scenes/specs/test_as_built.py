"""The specification of what is not as designed: grades, short forms, and what a robot is told of it."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.as_built import CAREFUL, GRADES, AsBuiltSpec
from msrr_scenes.specs.scene import Scene


def spec(data: Any) -> AsBuiltSpec:
    return AsBuiltSpec.model_validate(data)


def test_without_a_word_all_is_as_designed() -> None:
    assert load_scene("weak_lock").as_built == AsBuiltSpec() == spec("perfect") == spec({})
    assert not [d for _, _, d in AsBuiltSpec().deviations() if d.sigma or d.error is not None]


def test_the_grades_are_multiples_of_careful() -> None:
    """Every quantity of the table exists, and every one that is not in it is as designed at every grade."""
    for grade, factor in GRADES.items():
        sigmas = {(group, quantity): d.sigma for group, quantity, d in spec(grade).deviations()}
        listed = {(group, q): factor * s for group, sigmas in CAREFUL.items() for q, s in sigmas.items()}
        assert {key: sigma for key, sigma in sigmas.items() if sigma} == {
            k: s for k, s in listed.items() if s
        }


def test_a_number_is_the_true_error_and_leaves_the_tolerance_of_the_grade() -> None:
    given = spec({"grade": "workshop", "onboard": {"yaw_deg": 2, "x_m": {"sigma": 0.001}}})
    assert (given.onboard.yaw_deg.error, given.onboard.yaw_deg.sigma) == (2.0, 0.6)
    assert (given.onboard.x_m.error, given.onboard.x_m.sigma) == (None, 0.001)
    assert given.onboard.y_m == spec("workshop").onboard.y_m
    assert str(given) == "workshop but for onboard.x_m, onboard.yaw_deg = 2"
    assert [str(spec(grade)) for grade in GRADES] == list(GRADES)


def test_a_specification_is_read_back_as_it_was_written() -> None:
    given = spec({"grade": "rough", "floor": {"ridge_m": 0.002}})
    assert AsBuiltSpec.model_validate_json(given.model_dump_json()) == given


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("carefull", "perfect"),
        ({"grade": ["careful"]}, "perfect"),
        ({"onboard": {"yaw_deg": True}}, "found"),
        ({"onboard": {"yaw_deg": {"error": 90}}}, "45"),
        ({"grade": "careful", "drive": {"lag_ms": -5}}, "greater than or equal to 0"),
        ({"grade": "careful", "onboard": 3}, "dictionary"),
        ({"onboard": {"yaw": 1}}, "Extra"),
    ],
)
def test_what_makes_no_sense_is_refused(data: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        spec(data)


def test_a_robot_is_told_tolerances_and_no_error_and_no_fault() -> None:
    changes = {
        "as_built": "{grade: careful, onboard: {yaw_deg: 2}, floor: {ridge_m: 0.002}}",
        "faults": "[{kind: camera_misaligned, unit: a, yaw_deg: 7}]",
    }
    scene: Scene = load_scene("close_range", changes)
    told = scene.told()
    assert told.faults == ()
    assert not [name for *name, d in told.as_built.deviations() if d.error is not None]
    sigmas, told_sigmas = ([d.sigma for *_, d in s.as_built.deviations()] for s in (scene, told))
    assert told_sigmas == sigmas
    assert told.model_copy(update={"as_built": scene.as_built, "faults": scene.faults}) == scene
    assert told.told() == told


def test_a_grade_gives_cameras_its_optics_where_the_scene_gives_none() -> None:
    careful = load_scene("two_units", {"as_built": "careful", "cameras.overhead.blur_px": "0.3"})
    overhead, onboard = careful.cameras.overhead, careful.cameras.onboard
    assert overhead is not None
    assert (onboard.noise_grey, onboard.blur_px, onboard.gamma, onboard.exposure_ms) == (4.0, 0.8, 1.2, 10.0)
    assert (overhead.noise_grey, overhead.blur_px) == (4.0, 0.3)
    again = type(careful).model_validate(careful.model_dump())
    assert again.cameras == careful.cameras
    perfect = load_scene("two_units", {"as_built": "perfect"}).cameras
    assert perfect == type(perfect).model_validate({"overhead": {}})
    workshop = load_scene("close_range", {"as_built": "workshop"}).cameras
    assert workshop.overhead is None
    assert (workshop.onboard.noise_grey, workshop.onboard.blur_px) == (8.0, 1.131)


@pytest.mark.parametrize("name", ["two_units", "weak_lock"])
@pytest.mark.parametrize("grade", GRADES)
def test_a_scene_at_another_grade_is_the_one_that_names_it(name: str, grade: str) -> None:
    """And what it gives of a camera itself stays."""
    given = {"cameras.onboard.gamma": "1.1", "as_built.onboard.yaw_deg": "2"}
    scene = load_scene(name, {**given, "as_built.tags.x_m": "0.001"})
    assert scene.at_grade(grade) == load_scene(name, {"cameras.onboard.gamma": "1.1", "as_built": grade})
