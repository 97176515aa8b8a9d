"""What a robot makes of what was built: laws of single errors, and agreement with rendered images."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from msrr_bullet.profiler import NullProfiler
from msrr_bullet.sensors.calibrated_sight import OnboardSight, OverheadSight
from msrr_bullet.sensors.devices import Devices
from msrr_bullet.sensors.frame_sequence import FrameSequence
from msrr_bullet.sensors.parametric_cameras import ParametricOnboardCamera
from msrr_bullet.simulation.simulation import open_simulation
from msrr_perception.detection.detector import PupilDetector
from msrr_perception.pose.joint_pose import joint_pose
from msrr_perception.pose.overhead_model import OverheadModel
from msrr_perception.pose.target import TargetModel
from msrr_scenes.as_built import AsBuilt, BuiltCamera, draw_as_built
from msrr_scenes.errors import GeometryError, SceneError
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.loading.load import load_scene
from msrr_scenes.messages import Detections, Exposure, Fetch, TagDetection
from msrr_scenes.placement.placement import Placement
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none

X_DU = SE2(-0.35, 0.03, -0.08)
KNOWN = "{fx_px: 420, fy_px: 410, cx_px: 330, cy_px: 235, k1: -0.2, k2: 0.04, p1: 0.001}"


def scene(as_built: str, name: str = "close_range", **changes: str) -> Scene:
    return load_scene(name, {"as_built": as_built, "plant": "unicycle", **changes})


def sight(as_built: str) -> OnboardSight:
    of = scene(as_built, perception="parametric")
    return OnboardSight(of, draw_as_built(of, 0), of.docks[0])


def seen(of: OnboardSight, X: SE2) -> SE2:
    pose, _ = of.see(X)
    assert pose is not None
    return pose


def assert_near(X: SE2, Y: SE2, m: float, rad: float) -> None:
    assert math.hypot(X.x - Y.x, X.y - Y.y) < m
    assert abs(X.yaw - Y.yaw) < rad


def test_of_what_is_as_designed_the_robot_makes_the_truth() -> None:
    true, of = sight("perfect"), scene("perfect")
    assert_near(seen(true, X_DU), X_DU, 1e-6, 1e-6)
    _, bearings = true.see(X_DU)
    X_UC = of.geometry("a").frame("camera").to_se2()
    assert bearings == pytest.approx(of.los.edge_bearings(X_DU @ X_UC), abs=5e-4)  # of rounded edges


def test_behind_a_lens_that_it_is_told_the_robot_sees_the_truth() -> None:
    numbers = "fx_px: 970, fy_px: 950, cx_px: 650, cy_px: 470, k1: -0.2, k2: 0.05, p1: 0.001"
    known = {"cameras.onboard.calibration": KNOWN, "cameras.overhead.calibration": f"{{{numbers}}}"}
    of = scene("perfect", "two_units", **known)
    assert_near(seen(OnboardSight(of, draw_as_built(of, 0), of.docks[0]), X_DU), X_DU, 1e-6, 1e-6)
    X_WA = SE2(-0.9, -0.8, 0.4)
    from_above = not_none(OverheadSight(of, draw_as_built(of, 0)).see("a", X_WA))
    assert_near(from_above, X_WA, 1e-6, 1e-6)


def test_a_tag_between_the_edges_is_enough_for_a_pose() -> None:
    """From near by, the outer tags of the port are cut off in a narrow picture; the one above them is whole.

    With a camera 3 cm further forward, it would be as near in the seat.
    """
    of = scene("careful", perception="parametric", **{"cameras.onboard.hfov_deg": "65"})
    near, spec = SE2(-0.07, 0.0, 0.0), of.cameras.onboard
    frames = FrameSequence("a/onboard", spec, BuiltCamera(spec.pinhole), seed=1)
    narrow = OnboardSight(of, draw_as_built(of, 0), of.docks[0])
    assert narrow.see(near)[1] == (None, None)
    camera = ParametricOnboardCamera(of, of.docks[0], lambda: near, stream(1, "seat"), frames, narrow)
    (measured,) = camera.capture(0, None)
    assert_near(measured.X_DU, near, 0.01, 0.02)
    assert measured.edge_bearings == (None, None)


@pytest.mark.parametrize(
    ("key", "E"), [("yaw_deg: 1", SE2(0, 0, math.radians(1))), ("y_m: 0.003", SE2(0, 0.003))]
)
def test_an_error_of_the_mount_moves_the_pose_by_as_much(key: str, E: SE2) -> None:
    """The camera sits over the axle, so that robot and camera are wrong by the same motion."""
    assert_near(seen(sight(f"{{onboard: {{{key}}}}}"), X_DU), X_DU @ E, 2e-5, 1e-4)


def test_roll_is_taken_for_a_roll_of_the_unit() -> None:
    """A camera 155 mm above the floor is believed to stand beside the unit by its height times the angle."""
    pose = seen(sight("{onboard: {roll_deg: 1}}"), SE2(-0.25, 0.0, 0.0))
    assert pose.y == pytest.approx(0.155 * math.radians(1.0), rel=0.05)


def test_a_print_that_is_too_large_looks_near() -> None:
    assert seen(sight("{tags: {print_percent: 3}}"), X_DU).x > X_DU.x + 0.002


def test_a_tag_out_of_view_gives_no_pose() -> None:
    assert sight("careful").see(SE2(-0.35, 0.0, math.pi)) == (None, (None, None))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_edge_that_leaves_the_view_first_has_no_bearing_and_the_other_one_keeps_its_own(
    side: float,
) -> None:
    """A unit that turns to the left has the target to its right."""
    of, true = scene("perfect"), sight("perfect")
    X = SE2(-0.35, 0.0, side * math.radians(33.0))
    pose, (left, right) = true.see(X)
    assert pose is not None
    assert_near(pose, X, 1e-6, 1e-6)
    kept, lost = (left, right) if side > 0.0 else (right, left)
    assert lost is None
    bearings = of.los.edge_bearings(X @ of.geometry("a").frame("camera").to_se2())
    assert kept == pytest.approx(bearings[0 if side > 0.0 else 1], abs=5e-4)


def test_a_tag_beyond_the_fold_of_the_lens_is_not_in_view() -> None:
    """The polynomial of k1 = -0.1 leads back into the frame from 61 deg on, and to its middle at 72 deg."""
    told = "{fx_px: 417, fy_px: 417, cx_px: 319.5, cy_px: 239.5, k1: -0.1}"
    of = scene("careful", perception="parametric", **{"cameras.onboard.calibration": told})
    there = OnboardSight(of, draw_as_built(of, 0), of.docks[0])
    for degrees in np.arange(50.0, 85.0, 0.25):
        assert there.see(SE2(-0.6, 0.0, math.radians(degrees))) == (None, (None, None))


def test_a_lens_that_cannot_be_drawn_cannot_be_modelled() -> None:
    """A scene that says so is refused; a lens may also be drawn so, of deviations that are far too large."""
    of = scene("careful", "two_units", perception="parametric")
    built, barrel = draw_as_built(of, 0), Distortion(k1=-0.9)
    a = replace(built.units["a"], camera=replace(built.units["a"].camera, distortion=barrel))
    folds = replace(built, units={**built.units, "a": a}, overhead=replace(built.overhead, distortion=barrel))
    with pytest.raises(GeometryError, match="no inverse"):
        OnboardSight(of, folds, of.docks[0])
    with pytest.raises(GeometryError, match="no inverse"):
        OverheadSight(of, folds)
    with pytest.raises(SceneError, match=r"as_built.overhead: with .* two points of the scene appear"):
        scene("{overhead: {k1: -0.9}}", "two_units", perception="parametric")


class Photographer:
    """A reader that detects the tags of whole frames."""

    def __init__(self, camera: PinholeCamera) -> None:
        self.frame = camera.frame
        self.tags: tuple[TagDetection, ...] = ()

    def uses_camera(self, camera: str) -> bool:
        return True

    def expose(self, exposure: Exposure, fetch: Fetch) -> Detections:
        self.tags = PupilDetector().detect(fetch(self.frame), self.frame)
        return Detections(exposure, self.tags, ())


@contextmanager
def devices_of(of: Scene, seed: int, placement: Placement) -> Iterator[tuple[Devices, AsBuilt]]:
    built = draw_as_built(of, seed)
    with open_simulation(of, placement, built) as simulation:
        yield Devices(simulation, seed), built


def test_rendered_images_tell_the_robot_the_same() -> None:
    """Six careful draws: within the noise of one frame, where the truth is up to several millimetres away."""
    of = scene("careful")
    step, told = of.docks[0], TargetModel.from_scene(of.told(), of.docks[0])
    X_WB = of.units["b"].pose.nominal
    X_WA = X_WB @ of.geometry("b").dock_frame("rear") @ X_DU
    off = []
    for seed in range(6):
        reader = Photographer(of.cameras.onboard.pinhole)
        with devices_of(of, seed, Placement({"b": X_WB, "a": X_WA}, {})) as (devices, built):
            devices.onboard(step, lambda: X_DU, NullProfiler()).capture(0, reader)
            expected = seen(OnboardSight(of, built, step), X_DU)
        found = not_none(joint_pose(told, [tag for tag in reader.tags if tag.tag_id in told.port_tags]))
        assert_near(found.X_DU, expected, 2e-3, math.radians(0.4))
        off.append(math.hypot(expected.x - X_DU.x, expected.y - X_DU.y))
    assert max(off) > 4e-3


@pytest.mark.nightly
def test_rendered_images_from_above_tell_the_base_station_the_same() -> None:
    of = scene("careful", "two_units")
    model = OverheadModel.from_scene(of.told(), ())
    poses = {"a": SE2(-0.8, -0.5, 0.4), "b": SE2(1.0, 0.6, -0.3)}
    post = SE2(0.1, 0.5, 1.0)
    off = []
    for seed in range(3):
        reader = Photographer(model.camera)
        with devices_of(of, seed, Placement(poses, {"post": post})) as (devices, built):
            devices.overhead(NullProfiler()).capture(0, reader)
            overhead = OverheadSight(of, built)
        located = model.localizer().locate(Detections(Exposure("overhead", 0, 0), reader.tags, ()))
        assert {pose.name for pose in located} == {"a", "b", "post"}
        for pose in located:
            true = {**poses, "post": post}[pose.name]
            expected = not_none(overhead.see(pose.name, true))
            assert_near(pose.X_WB, expected, 1e-3, math.radians(0.5))
            off.append(math.hypot(expected.x - true.x, expected.y - true.y))
    assert max(off) > 5e-3


def test_the_parametric_camera_measures_what_the_sight_says() -> None:
    quiet = {f"parametric.sigma_{q}": "0" for q in ("xy_m", "yaw_deg", "bearing_deg")}
    of = scene("workshop", perception="parametric", **quiet)
    step = of.docks[0]
    X_WB = of.units["b"].pose.nominal
    X_WA = X_WB @ of.geometry("b").dock_frame("rear") @ X_DU
    with devices_of(of, 2, Placement({"b": X_WB, "a": X_WA}, {})) as (devices, built):
        (message,) = devices.onboard(step, lambda: X_DU, NullProfiler()).capture(10**9, None)
        pose, bearings = OnboardSight(of, built, step).see(X_DU)
        clock_ns = built.units["a"].camera.clock_ahead_ns
    assert (message.X_DU, message.edge_bearings) == (pose, bearings)
    assert message.exposure.stamp_ns == 10**9 + clock_ns
    assert clock_ns != 0
    assert not np.allclose(message.X_DU.as_array(), X_DU.as_array(), atol=1e-4)
