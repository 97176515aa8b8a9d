"""Specifications: every key of a scene describes itself, and the limits are filled in by their setting."""

from typing import Any

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import load_scene
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.vehicle import LIMIT_SETTINGS, LimitsSpec


def test_every_key_has_a_description() -> None:
    schema = Scene.model_json_schema()
    models: dict[str, Any] = {"Scene": schema, **schema["$defs"]}
    keys = {
        (name, key): field for name, model in models.items() for key, field in model["properties"].items()
    }
    assert len(keys) > 150
    assert [key for key, field in keys.items() if not field.get("description", "").strip()] == []


@pytest.mark.parametrize("setting", LIMIT_SETTINGS)
def test_a_setting_fills_in_the_limits_that_are_not_given(setting: str) -> None:
    limits = LimitsSpec.model_validate({"setting": setting, "v_max_mps": 0.2})
    expected = {**LIMIT_SETTINGS[setting], "setting": setting, "v_max_mps": 0.2}
    assert limits.model_dump() == expected


def test_delay_compensation_is_no_parameter_of_an_estimator() -> None:
    """The message was about multiple values for an argument, and did not say what to set instead."""
    off = {"control.estimator.params.delay_compensation": "false"}
    with pytest.raises(SceneError, match=r"set control\.delay_compensation, and take it out of the params"):
        load_scene("close_range", off)


def test_robots_are_told_the_noise_of_a_localisation_alone_and_no_silences_of_the_radio() -> None:
    scene = load_scene("biased_localisation")
    true, told = scene.cameras.overhead, scene.told().cameras.overhead
    assert true is not None
    assert told is not None
    noise = true.localisation
    assert noise.noise_m > 0.0
    assert told.localisation == type(noise)(noise_m=noise.noise_m, noise_yaw_deg=noise.noise_yaw_deg) != noise
    assert told.model_copy(update={"localisation": noise}) == true
    silent = load_scene("two_units", {"radio": "{silences: [{from_s: 1, until_s: 2}], loss: 0.1}"})
    radio = silent.told().radio
    assert radio is not None
    assert (radio.silences, radio.loss) == ((), 0.1)
