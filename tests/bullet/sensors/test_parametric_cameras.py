"""Cameras without pixels: sizes of the errors, the field of view, and the independence of the sequences."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from msrr_bullet.sensors.frame_sequence import FrameSequence
from msrr_bullet.sensors.parametric_cameras import (
    MIN_SIGMA,
    ParametricOnboardCamera,
    ParametricOverheadCamera,
)
from msrr_perception.estimation.los import edge_bearings
from msrr_perception.pose.target import TargetModel
from msrr_scenes.as_built import BuiltCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.unit_geometry import find_urdf
from msrr_scenes.messages import GlobalPose, PoseMeasurement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.bodies import UnitSpec
from msrr_scenes.specs.scene import Scene
from msrr_scenes.specs.sensors import CameraSpec

X_DU = SE2(-0.5, 0.02, 0.05)
N = 2000


def scene(faults: tuple[Mapping[str, Any], ...] = (), **errors: float) -> Scene:
    return Scene.model_validate(
        {
            "name": "blind",
            "perception": "parametric",
            "parametric": errors,
            "units": {"a": {"number": 0}, "b": {"number": 1}},
            "obstacles": {
                "late": {"shape": "cylinder", "radius_m": 0.05, "appears_at_s": 1.0, "tag_id": 300},
                "bare": {"shape": "cylinder", "radius_m": 0.05},
            },
            "cameras": {"overhead": {}},
            "faults": faults,
            "plan": [{"unit": "a", "to": "b.rear"}],
        }
    )


def frames_of(name: str, spec: CameraSpec, dropout: float) -> FrameSequence:
    lossy = spec.model_copy(update={"dropout": dropout})
    return FrameSequence(name, lossy, BuiltCamera(spec.pinhole), seed=1)


def onboard(of: Scene, X: SE2 = X_DU, dropout: float = 0.0, count: int = N) -> list[PoseMeasurement | None]:
    """Frames of a unit that stands at X in the dock frame; None where there is no measurement."""
    frames = frames_of("a/onboard", of.cameras.onboard, dropout)
    camera = ParametricOnboardCamera(of, of.plan[0], lambda: X, stream(1, "parametric"), frames)
    captured = [camera.capture(k, None) for k in range(count)]  # the robot is not asked
    return [m[0] if m else None for m in captured]


def assert_sigma(errors: np.ndarray, sigma: float) -> None:
    """Check zero-mean normal errors; the interval contains all but 1 in 10,000 samples."""
    low, high = chi2.ppf([5e-5, 1 - 5e-5], len(errors))
    assert low < float((errors**2).sum()) / sigma**2 < high


def test_errors_of_the_onboard_camera_have_the_stated_sizes() -> None:
    of = scene(sigma_xy_m=0.004, sigma_yaw_deg=0.5, sigma_bearing_deg=0.3)
    measured = [m for m in onboard(of) if m is not None]
    assert len(measured) == N
    errors = np.array([m.X_DU.as_array() - X_DU.as_array() for m in measured])
    sigmas = (0.004, 0.004, math.radians(0.5))
    for i, sigma in enumerate(sigmas):
        assert_sigma(errors[:, i], sigma)
    np.testing.assert_allclose(measured[0].covariance, np.diag(np.square(sigmas)))
    X_UC = of.geometry("a").frame("camera").to_se2()
    true = of.los.edge_bearings(X_DU @ X_UC)
    bearings = np.array([m.edge_bearings for m in measured], dtype=float)
    for side in range(2):
        assert_sigma(bearings[:, side] - true[side], math.radians(0.3))


def test_true_bearings_are_those_that_the_robot_expects() -> None:
    """The robot knows the tags, and the paper's line-of-sight target has rounded dimensions."""
    of = scene()
    X_UC = of.geometry("a").frame("camera").to_se2()
    expected = edge_bearings(TargetModel.from_scene(of, of.plan[0]), X_DU)
    assert of.los.edge_bearings(X_DU @ X_UC) == pytest.approx(expected, abs=2e-4)


def test_without_errors_the_measurement_is_true_and_the_covariance_is_not_zero() -> None:
    exact = onboard(scene(sigma_xy_m=0.0, sigma_yaw_deg=0.0, sigma_bearing_deg=0.0))[0]
    assert exact is not None
    assert exact.X_DU == X_DU
    np.testing.assert_allclose(exact.covariance, MIN_SIGMA**2 * np.eye(3))


def test_an_edge_outside_the_field_of_view_is_not_measured() -> None:
    """A unit turns on the spot: both edges, one edge, and no edge in view."""
    of = scene()
    half_fov, X_UC = of.cameras.onboard.lens.half_fov, of.geometry("a").frame("camera").to_se2()
    numbers = set()
    for yaw in np.linspace(-math.pi, math.pi, 61):
        X = SE2(-0.5, 0.0, float(yaw))
        visible = [abs(bearing) <= half_fov for bearing in of.los.edge_bearings(X @ X_UC)]
        measured = onboard(of, X, count=1)[0]
        assert (measured is not None) is any(visible)
        if measured is not None:
            assert [bearing is not None for bearing in measured.edge_bearings] == visible
        numbers.add(sum(visible))
    assert numbers == {0, 1, 2}


def test_lost_frames_and_a_hidden_marker_do_not_change_the_errors() -> None:
    hidden = {"kind": "marker_hidden", "unit": "b"}
    elsewhere = {"kind": "marker_hidden", "unit": "a"}
    plain, lossy = onboard(scene()), onboard(scene(), dropout=0.3)
    assert onboard(scene((hidden,))) == [None] * N
    for m, same in zip(plain, onboard(scene((elsewhere,))), strict=True):
        assert m is not None
        assert same is not None
        assert (m.X_DU, m.exposure.frame) == (same.X_DU, same.exposure.frame)
    kept = [i for i, m in enumerate(lossy) if m is not None]
    assert 0.6 * N < len(kept) < 0.8 * N
    for i in kept:
        assert lossy[i].X_DU == plain[i].X_DU
        assert lossy[i].exposure.frame == i


POSES = {"a": SE2(-1.0, 0.2, 0.5), "b": SE2(1.0, -0.3, 2.0), "late": SE2(0.1, 0.4, 0.0)}


def overhead(of: Scene, poses: Mapping[str, SE2], dropout: float = 0.0) -> list[dict[str, GlobalPose]]:
    spec = of.cameras.overhead
    assert spec is not None
    frames = frames_of("overhead", spec, dropout)
    camera = ParametricOverheadCamera(of, spec, lambda: poses, lambda body: stream(1, body), frames)
    captured = [camera.capture(k, None) for k in range(N)]
    return [{m.name: m for m in messages if isinstance(m, GlobalPose)} for messages in captured]


def test_errors_of_the_overhead_camera_have_the_stated_sizes() -> None:
    frames = overhead(scene(sigma_xy_m=0.004, sigma_yaw_deg=0.5), POSES)
    for name, X in POSES.items():
        errors = np.array([frame[name].X_WB.as_array() - X.as_array() for frame in frames])
        for i, sigma in enumerate((0.004, 0.004, math.radians(0.5))):
            assert_sigma(errors[:, i], sigma)


def test_an_obstacle_without_a_tag_is_not_measured() -> None:
    poses = {**POSES, "bare": SE2(0.5, 0.5, 0.0)}
    assert all(frame.keys() == POSES.keys() for frame in overhead(scene(), poses))


def test_a_unit_whose_roof_shows_no_tag_is_not_measured(tmp_path: Path) -> None:
    """The markers of b are covered, that on its roof as well; c was built without one."""
    text = find_urdf("unit.urdf").read_text()
    roof = r'<link name="tag_top">.*?</link>\s*<joint name="tag_top_joint".*?</joint>'
    (tmp_path / "topless.urdf").write_text(re.sub(roof, "", text, flags=re.DOTALL))
    covered = scene(({"kind": "marker_hidden", "unit": "b"},))
    units = {**covered.units, "c": UnitSpec(number=2, urdf=str(tmp_path / "topless.urdf"))}
    poses = {**POSES, "c": SE2(0.5, 0.5, 0.0)}
    frames = overhead(covered.model_copy(update={"units": units}), poses)
    assert all(frame.keys() == {"a", "late"} for frame in frames)


def test_errors_of_a_body_depend_neither_on_other_bodies_nor_on_lost_frames() -> None:
    alone = {name: POSES[name] for name in ("a", "b")}
    with_late, without, lossy = (
        overhead(scene(), POSES),
        overhead(scene(), alone),
        overhead(scene(), POSES, dropout=0.3),
    )
    for every, some, kept in zip(with_late, without, lossy, strict=True):
        assert some.keys() == alone.keys()
        assert all(every[name].X_WB == some[name].X_WB for name in alone)
        assert not kept or all(every[name].X_WB == kept[name].X_WB for name in POSES)
    bare = scene().model_copy(update={"obstacles": {}})
    for every, some in zip(with_late, overhead(bare, alone), strict=True):
        assert all(every[name].X_WB == some[name].X_WB for name in alone)
    assert 0.6 * N < sum(bool(frame) for frame in lossy) < 0.8 * N
