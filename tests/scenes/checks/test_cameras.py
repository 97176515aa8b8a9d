"""Cameras that cannot be drawn, or whose times contradict each other, are refused with the mend."""

from __future__ import annotations

import pytest

from msrr_scenes.errors import SceneError
from msrr_scenes.loading.load import check_scene, load_scene
from msrr_scenes.specs.spec import Choice


@pytest.mark.parametrize(
    ("key", "changes", "message"),
    [
        ("exposure_ms", {"exposure_ms": "0.1", "renderer": "tiny"}, "use renderer raster"),
        ("rolling_shutter_ms", {"rolling_shutter_ms": "0.1", "renderer": "tiny"}, "use renderer raster"),
        ("exposure_ms", {"exposure_ms": "41"}, "time between two frames, 40 ms"),
        ("latency_ms", {"exposure_ms": "10", "rolling_shutter_ms": "20", "latency_ms": "14"}, "15 ms after"),
    ],
)
@pytest.mark.parametrize("camera", ["onboard", "overhead"])
def test_a_camera_that_cannot_be_is_refused(
    camera: str, key: str, changes: dict[str, str], message: str
) -> None:
    rate = {"as_built": "perfect", f"cameras.{camera}.rate_hz": "25"}
    prefixed = rate | {f"cameras.{camera}.{name}": value for name, value in changes.items()}
    with pytest.raises(SceneError, match=message) as refused:
        load_scene("two_units", prefixed)
    assert f"cameras.{camera}.{key}" in str(refused.value)
    blind = load_scene("two_units", rate | {"perception": "parametric"})
    spec = getattr(blind.cameras, camera)
    check_scene(blind.with_camera(camera, type(spec).model_validate({**spec.model_dump(), **changes})))


def test_the_cone_is_compared_with_what_the_onboard_camera_sees() -> None:
    """A camera of 417 px sees 37.5 deg to a side, also if that is told by a calibration."""
    told = "{fx_px: 417, fy_px: 417, cx_px: 319.5, cy_px: 239.5}"
    for camera, mend in (
        ({}, "or raise cameras.onboard.hfov_deg"),
        ({"cameras.onboard.calibration": told}, "or use a camera that sees more"),
    ):
        load_scene("two_units", {**camera, "los.outer_deg": "37.4"})
        with pytest.raises(SceneError, match=mend):
            load_scene("two_units", {**camera, "los.outer_deg": "37.6"})


def test_nothing_is_said_of_a_renderer_that_there_is_not() -> None:
    """Whoever builds it tells the names that there are; the check is of shipped ones."""
    load_scene("close_range", {"cameras.onboard.renderer": "rastr", "as_built": "careful"})


def test_times_that_just_fit_are_accepted() -> None:
    spec = {"exposure_ms": "40", "rolling_shutter_ms": "40", "latency_ms": "40"}
    load_scene("two_units", {f"cameras.onboard.{key}": value for key, value in spec.items()})


@pytest.mark.parametrize("deviation", ["-0.05", "{sigma: 0.01}"])
def test_a_lens_that_the_renderer_does_not_draw_is_refused(deviation: str) -> None:
    tiny = {"as_built": "perfect", "as_built.onboard.k1": deviation, "cameras.onboard.renderer": "tiny"}
    with pytest.raises(SceneError, match="'tiny' draws ideal lenses only"):
        load_scene("close_range", tiny)
    drawn = load_scene("close_range", tiny | {"cameras.onboard.renderer": "raster"})
    spec = drawn.cameras.onboard.model_copy(update={"renderer": Choice(name="tiny")})
    check_scene(drawn.model_copy(update={"perception": "parametric"}).with_camera("onboard", spec))


def test_a_renderer_of_one_instant_and_ideal_lenses_goes_with_perfect_calibration() -> None:
    """And both messages about it say so, for exposure and distortion come with a grade."""
    tiny = {"as_built": "careful", "cameras.onboard.renderer": "tiny"}
    with pytest.raises(SceneError) as refused:
        load_scene("close_range", tiny)
    assert len(lines := str(refused.value).splitlines()) == 2
    assert all("as_built: perfect" in line for line in lines)
    load_scene("close_range", tiny | {"as_built": "perfect"})


def test_a_lens_that_folds_the_frame_is_refused() -> None:
    """k1 = -0.2 shows nothing beyond 0.86 focal lengths; the corner of a frame of 75 deg is at 0.96."""
    folded = {"as_built.onboard.k1": "-0.2"}
    with pytest.raises(SceneError, match="two points of the scene appear at one pixel"):
        load_scene("close_range", folded)
    load_scene("close_range", folded | {"cameras.onboard.hfov_deg": "62"})
