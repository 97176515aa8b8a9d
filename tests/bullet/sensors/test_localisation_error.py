"""Errors of an outdoor localisation: sizes, the bodies that they affect, and how they are drawn."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_bullet.sensors.localisation_error import LocalisationError
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Detections, Exposure, TagDetection
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import LocalisationErrorSpec

#: Prepared once for a model.
localizer = cache(OverheadModel.localizer)

POSES = {"a": SE2(-1.2, 0.7, 0.6), "b": SE2(1.0, -0.2, -2.0), "post": SE2(0.1, 0.4, 0.0)}


POST = {"post": {"shape": "cylinder", "radius_m": 0.06, "tag_id": 500}}


@pytest.fixture(scope="module")
def model() -> OverheadModel:
    return model_with(POST)


def model_with(obstacles: dict[str, dict[str, object]]) -> OverheadModel:
    scene = Scene.model_validate(
        {
            "name": "outdoors",
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "obstacles": obstacles,
            "cameras": {"overhead": {"x_m": 0.3, "y_m": -0.2}},
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )
    return OverheadModel.from_scene(scene, ("a", "b"))


def exact_detections(model: OverheadModel, frame: int, names: tuple[str, ...] = tuple(POSES)) -> Detections:
    """Exact detections at 10 Hz."""
    return Detections(Exposure("overhead", frame, frame * 100_000_000), exact_tags(model, names), ())


@cache
def exact_tags(model: OverheadModel, names: tuple[str, ...]) -> tuple[TagDetection, ...]:
    locator = localizer(model)
    return tuple(
        TagDetection(model.tag_of[n], locator.pixels(model.tags[model.tag_of[n]], POSES[n])) for n in names
    )


def errors(model: OverheadModel, detections: Detections) -> dict[str, np.ndarray]:
    found = {}
    for pose in localizer(model).locate(detections):
        e = pose.X_WB.as_array() - POSES[pose.name].as_array()
        e[2] = math.remainder(e[2], 2.0 * math.pi)
        found[pose.name] = e
    return found


def test_bias_moves_the_docking_unit_and_no_other_body(model: OverheadModel) -> None:
    spec = LocalisationErrorSpec(bias_x_m=0.03, bias_y_m=-0.02, bias_yaw_deg=2.0)
    error = LocalisationError(spec, seed=1)
    for frame in range(3):
        found = errors(model, error.apply(exact_detections(model, frame), model, "a"))
        np.testing.assert_allclose(found["a"], [0.03, -0.02, math.radians(2.0)], atol=1e-9)
        np.testing.assert_allclose(found["b"], 0.0, atol=1e-9)
        np.testing.assert_allclose(found["post"], 0.0, atol=1e-9)


def test_without_errors_detections_are_not_changed(model: OverheadModel) -> None:
    before = exact_detections(model, 0)
    after = LocalisationError(LocalisationErrorSpec(), seed=1).apply(before, model, "a")
    assert all(x is y for x, y in zip(before.tags, after.tags, strict=True))


def test_image_noise_is_not_changed(model: OverheadModel) -> None:
    """The residuals of a moved tag stay: the error is one of the pose, not of the image."""
    spec = LocalisationErrorSpec(bias_x_m=0.03, bias_yaw_deg=2.0)
    clean = exact_detections(model, 0, ("a",))
    shaken = replace(
        clean,
        tags=(
            replace(
                clean.tags[0],
                corners=clean.tags[0].corners + np.array([[0.2, 0], [0, -0.2], [-0.2, 0], [0, 0.2]]),
            ),
        ),
    )
    moved, moved_shaken = (
        LocalisationError(spec, seed=1).apply(d, model, "a").tags[0].corners for d in (clean, shaken)
    )
    by_noise = np.linalg.norm(moved_shaken - moved, axis=1)
    np.testing.assert_allclose(by_noise, 0.2, rtol=0.05)


def test_noise_drift_and_dropout_have_the_sizes_given(model: OverheadModel) -> None:
    """Each interval contains all but 1 in 10,000 draws of 300 frames."""
    n = 300
    spec = LocalisationErrorSpec(noise_m=0.01, noise_yaw_deg=1.0, dropout=0.1)
    error = LocalisationError(spec, seed=2)
    found = [errors(model, error.apply(exact_detections(model, frame), model, "a")) for frame in range(n)]
    for name in POSES:
        drawn = np.array([f[name] for f in found if name in f])
        kept = len(drawn)
        assert abs(kept - 0.9 * n) < 3.9 * math.sqrt(n * 0.1 * 0.9)
        low, high = chi2.ppf([5e-5, 1 - 5e-5], kept)
        for i, sigma in enumerate((0.01, 0.01, math.radians(1.0))):
            assert low < float((drawn[:, i] ** 2).sum()) / sigma**2 < high
    walk = LocalisationError(LocalisationErrorSpec(drift_m=0.01, drift_yaw_deg=0.5), seed=3)
    path = np.array(
        [errors(model, walk.apply(exact_detections(model, frame), model, "a"))["a"] for frame in range(n)]
    )
    np.testing.assert_allclose(path[0], 0.0, atol=1e-9)
    steps = np.diff(path, axis=0)
    low, high = chi2.ppf([5e-5, 1 - 5e-5], n - 1)
    for i, sigma in enumerate((0.01, 0.01, math.radians(0.5))):
        assert low < float((steps[:, i] ** 2).sum()) / (sigma**2 * 0.1) < high


def test_the_errors_do_not_depend_on_what_is_detected(model: OverheadModel) -> None:
    spec = LocalisationErrorSpec(noise_m=0.01, drift_m=0.01)
    every, alone = (LocalisationError(spec, seed=4) for _ in range(2))
    for frame in range(5):
        of_all = errors(model, every.apply(exact_detections(model, frame), model, "a"))
        of_one = errors(
            model, alone.apply(exact_detections(model, frame, ("a",) if frame != 2 else ()), model, "a")
        )
        if frame != 2:
            np.testing.assert_array_equal(of_all["a"], of_one["a"])
    other = LocalisationError(spec, seed=5).apply(exact_detections(model, 0), model, "a")
    assert not np.allclose(errors(model, other)["a"], of_all["a"])


def test_the_errors_of_a_body_do_not_depend_on_other_bodies(model: OverheadModel) -> None:
    spec = LocalisationErrorSpec(noise_m=0.01, noise_yaw_deg=1.0, drift_m=0.01, dropout=0.3)
    bare = model_with({})
    with_post, without = (LocalisationError(spec, seed=6) for _ in range(2))
    for frame in range(20):
        every = errors(model, with_post.apply(exact_detections(model, frame), model, "a"))
        some = errors(bare, without.apply(exact_detections(bare, frame, ("a", "b")), bare, "a"))
        assert some.keys() == every.keys() - {"post"}
        for name, error in some.items():
            np.testing.assert_array_equal(error, every[name])


def test_tags_of_no_body_are_not_changed(model: OverheadModel) -> None:
    foreign = TagDetection(333, np.array([[10.0, 40.0], [40.0, 40.0], [40.0, 10.0], [10.0, 10.0]]))
    spec = LocalisationErrorSpec(bias_x_m=0.03, noise_m=0.01)
    out = LocalisationError(spec, 1).apply(Detections(Exposure("overhead", 0, 0), (foreign,), ()), model, "a")
    assert out.tags == (foreign,)
