from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.estimation.los import LosEstimator, edge_bearings, measured_bearings
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.distortion import Distortion
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Detections, Exposure, LosStatus, PoseMeasurement
from msrr_scenes.specs.scene import Scene
from tests.perception.conftest import make_drive, see

MS = 1_000_000


def _paper(scene: Scene, X: SE2) -> list[float]:
    """Zheng et al., eq. 21: a = atan2(+-b - y_c, s_b - x_c) - th, for a camera above the axle."""
    b, s_b = scene.los.half_width_m, scene.los.setback_m
    return [math.atan2(side * b - X.y, s_b - X.x) - X.yaw for side in (1.0, -1.0)]


def _poses(n: int) -> list[SE2]:
    rng = np.random.default_rng(0)
    return [SE2(-rng.uniform(0.12, 0.8), rng.uniform(-0.08, 0.08), rng.uniform(-0.3, 0.3)) for _ in range(n)]


def test_bearings_from_a_pose_are_those_of_the_paper(scene: Scene, target: TargetModel) -> None:
    for X in _poses(100):
        np.testing.assert_allclose(
            edge_bearings(target, X), _paper(scene, X), atol=5e-4
        )  # b, s_b round to 0.1 mm


def test_bearings_of_a_camera_that_leans_are_those_in_its_own_frame(leaning: TargetModel) -> None:
    """Against the chain of frames."""
    for X in _poses(20):
        p_C = (SE3.from_se2(X) @ leaning.X_UC).inverse().act(np.array(leaning.edge_points_D))
        np.testing.assert_allclose(edge_bearings(leaning, X), np.arctan2(-p_C[:, 0], p_C[:, 2]), atol=1e-12)


def test_bearings_from_the_image_are_those_of_the_geometry(target: TargetModel) -> None:
    exposure = Exposure("a/onboard", 0, 0)
    for X in _poses(100):
        detections = Detections(exposure, see(pose_vector(X), target.port_tags), ())
        np.testing.assert_allclose(
            np.array(measured_bearings(target, detections), dtype=float), edge_bearings(target, X), atol=1e-9
        )


def test_bearing_noise_is_what_the_pixels_give(target: TargetModel) -> None:
    """0.3 px corners, two to an edge: 0.21 px = 0.03 degrees in mid-image; 300 views, 5 sigma."""
    rng, X, n = np.random.default_rng(1), SE2(-0.6, 0.0, 0.0), 300
    exact = np.array(edge_bearings(target, X))
    errors = [
        np.array(
            measured_bearings(
                target, Detections(Exposure("c", 0, 0), see(pose_vector(X), target.port_tags, rng), ())
            ),
            dtype=float,
        )
        - exact
        for _ in range(n)
    ]
    expected = 0.3 / math.sqrt(2) / target.camera.focal
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)) / expected
    assert np.all(np.abs(ratio - 1.0) < 5.0 / math.sqrt(2 * n))


def _following(
    target: TargetModel, scene: Scene, drive: Any, ticks: int, **options: Any
) -> tuple[Any, LosEstimator]:
    """Follow a drive, whose corners have errors of 0.3 px, more than the data sheet of the camera says."""
    ekf, los = CornerEkf(target, scene.odometry, corner_sigma_px=0.3, **options), LosEstimator(target)
    _advance(drive, ekf, los, ticks)
    return ekf, los


def _advance(drive: Any, ekf: CornerEkf, los: LosEstimator, ticks: int, latency: int = 12) -> None:
    for _ in range(ticks):
        reading, picture = drive.step()
        ekf.add_odometry(reading)
        if picture is not None:
            drive.under_way.append((drive.tick + latency, picture))
        while drive.under_way and drive.under_way[0][0] <= drive.tick:
            detections = drive.under_way.pop(0)[1]
            ekf.add_detections(detections)
            los.add_detections(detections)


def _turning(X: SE2) -> tuple[float, float]:
    return 0.05, 0.3


def test_seen_edges_are_carried_to_now(target: TargetModel, scene: Scene) -> None:
    """Turning with 0.3 rad/s and 120 ms latency: stale angles would be 0.036 rad off."""
    drive = make_drive(0, X_DU=SE2(-0.7, 0.0, -0.35), speed=_turning)
    ekf, los = _following(target, scene, drive, 120)
    seen = los.observe(drive.now_ns, ekf)
    assert (seen.status, seen.stamp_ns) == (LosStatus.SEEN, drive.now_ns)
    np.testing.assert_allclose([seen.left, seen.right], edge_bearings(target, drive.X_DU), atol=0.004)
    assert seen.margin == target.lens.half_fov - max(abs(seen.left), abs(seen.right))


def test_the_margin_is_that_to_the_nearer_border_of_the_frame(target: TargetModel, scene: Scene) -> None:
    """A lens that shows 31 deg to the left and 40 deg to the right, with the target ahead."""
    drive = make_drive(0, X_DU=SE2(-0.7, 0.0, -0.35), speed=_turning)
    ekf, los = _following(target, scene, drive, 120)
    lens = Lens(replace(target.camera, offset=(-60.0, 0.0)), Distortion(k1=0.05))
    to_left, to_right = lens.field_of_view
    assert to_left < target.lens.half_fov < to_right
    ahead = los.observe(drive.now_ns, ekf)
    los.target = replace(target, lens=lens)
    seen = los.observe(drive.now_ns, ekf)
    assert (seen.left, seen.right) == (ahead.left, ahead.right)
    assert seen.margin == to_left - seen.left < ahead.margin


def test_without_compensation_the_angles_are_those_of_the_last_exposure(
    target: TargetModel, scene: Scene
) -> None:
    drive = make_drive(0, X_DU=SE2(-0.7, 0.0, -0.35), speed=_turning)
    ekf, los = _following(target, scene, drive, 120, delay_compensation=False)
    stale = los.observe(drive.now_ns, ekf)
    assert stale.status is LosStatus.SEEN
    assert stale.stamp_ns < drive.now_ns - 100 * MS
    lag = stale.left - edge_bearings(target, drive.X_DU)[0]
    assert 0.03 < lag < 0.06


def test_an_edge_out_of_view_is_predicted_then_all_is_lost(target: TargetModel, scene: Scene) -> None:
    drive = make_drive(1)
    ekf, los = _following(target, scene, drive, 100)
    drive.tags = target.port_tags[1:]  # the left tag is hidden
    _advance(drive, ekf, los, 60)
    found = los.observe(drive.now_ns, ekf)
    assert found.status is LosStatus.PREDICTED
    np.testing.assert_allclose([found.left, found.right], edge_bearings(target, drive.X_DU), atol=0.003)
    blind_ns = drive.now_ns
    for _ in range(80):  # nothing at all is seen
        ekf.add_odometry(drive.step()[0])
    assert los.observe(blind_ns + 300 * MS, ekf).status is LosStatus.PREDICTED
    lost = los.observe(drive.now_ns, ekf)
    assert lost.status is LosStatus.LOST
    np.testing.assert_allclose([lost.left, lost.right], edge_bearings(target, drive.X_DU), atol=0.02)


def test_tags_seen_in_turn_count_as_seen(target: TargetModel, scene: Scene) -> None:
    """Close up, one frame shows the left tag and the next one the right tag."""
    drive = make_drive(2, X_DU=SE2(-0.3, 0.0, 0.0))
    ekf, los = _following(target, scene, drive, 20)
    for turn in range(12):
        drive.tags = (target.port_tags[turn % 3],)
        _advance(drive, ekf, los, 4)
        assert los.observe(drive.now_ns, ekf).status is LosStatus.SEEN


def test_a_camera_with_a_long_latency_sees_the_target(target: TargetModel, scene: Scene) -> None:
    """0.7 s late every picture is older than half a second: the target was lost all the time."""
    late = replace(target, latency_s=0.7)
    drive = make_drive(3, speed=_turning)
    ekf, los = CornerEkf(late, scene.odometry), LosEstimator(late)
    _advance(drive, ekf, los, 100, latency=70)
    for _ in range(8):
        assert los.observe(drive.now_ns, ekf).status is LosStatus.SEEN
        _advance(drive, ekf, los, 1, latency=70)
    for _ in range(100):
        ekf.add_odometry(drive.step()[0])
    assert los.observe(drive.now_ns, ekf).status is LosStatus.LOST


def test_before_anything_is_known_it_is_lost_and_says_no_number(target: TargetModel, scene: Scene) -> None:
    los = LosEstimator(target).observe(5, CornerEkf(target, scene.odometry))
    assert los.status is LosStatus.LOST
    assert math.isnan(los.left)
    assert math.isnan(los.right)
    assert math.isnan(los.margin)


def test_a_target_beside_the_image_has_a_negative_margin(target: TargetModel, scene: Scene) -> None:
    ekf, los = CornerEkf(target, scene.odometry), LosEstimator(target)
    X = SE2(-0.5, 0.0, 0.75)
    ekf.add_pose(PoseMeasurement(Exposure("a/onboard", 0, 0), X, 1e-6 * np.eye(3), (None, None)))
    found = los.observe(0, ekf)
    assert found.status is LosStatus.PREDICTED
    assert found.margin < 0.0
    np.testing.assert_allclose([found.left, found.right], edge_bearings(target, X), atol=1e-9)


def test_bearings_of_ready_made_measurements_are_taken_as_seen(target: TargetModel, scene: Scene) -> None:
    ekf, los = CornerEkf(target, scene.odometry), LosEstimator(target)
    measurement = PoseMeasurement(
        Exposure("a/onboard", 0, 0), SE2(-0.5, 0.0, 0.0), 1e-6 * np.eye(3), (0.1, -0.09)
    )
    ekf.add_pose(measurement)
    los.add_pose(measurement)
    found = los.observe(0, ekf)
    assert (found.status, found.left, found.right) == (LosStatus.SEEN, 0.1, -0.09)
    los.reset()
    assert los.observe(0, ekf).status is LosStatus.PREDICTED


def test_an_older_picture_does_not_replace_a_newer_one(target: TargetModel, scene: Scene) -> None:
    ekf, los = CornerEkf(target, scene.odometry), LosEstimator(target)
    for frame, X in ((2, SE2(-0.5, 0.0, 0.0)), (1, SE2(-0.5, 0.0, 0.02))):
        picture = Detections(Exposure("a/onboard", frame, frame), see(pose_vector(X), target.port_tags), ())
        ekf.add_detections(picture)
        los.add_detections(picture)
    np.testing.assert_allclose(
        los.observe(2, ekf).left, edge_bearings(target, SE2(-0.5, 0.0, 0.0))[0], atol=1e-9
    )


def test_a_stranger_with_the_id_of_an_edge_is_not_taken_for_it(target: TargetModel, scene: Scene) -> None:
    """The filter rejects such a tag; its bearing went to the laws as that of an edge that is seen."""
    drive = make_drive(4, X_DU=SE2(-0.7, 0.0, 0.0), speed=lambda X: (0.0, 0.0))
    ekf, los = _following(target, scene, drive, 100)
    left, right = edge_bearings(target, drive.X_DU)
    stranger = see(pose_vector(SE2(-0.7, -0.2, 0.0)), target.port_tags[:1])  # 0.2 m farther to the left
    for frame in range(10):
        reading, _ = drive.step()
        ekf.add_odometry(reading)
        seen = see(pose_vector(drive.X_DU), target.port_tags[1:])
        picture = Detections(Exposure("a/onboard", 1000 + frame, drive.now_ns), (*stranger, *seen), ())
        assert measured_bearings(target, picture)[0] > left + 0.2
        ekf.add_detections(picture)
        los.add_detections(picture)
    found = los.observe(drive.now_ns, ekf)
    assert found.status is LosStatus.PREDICTED
    np.testing.assert_allclose([found.left, found.right], [left, right], atol=0.003)


def test_one_picture_from_the_future_does_not_stop_the_line_of_sight(
    target: TargetModel, scene: Scene
) -> None:
    """Pictures that came after one that was stamped 10 s ahead changed nothing for 10 s."""
    drive = make_drive(5, X_DU=SE2(-0.7, 0.0, -0.35), speed=_turning)
    ekf, los = _following(target, scene, drive, 60)
    ahead = Exposure("a/onboard", 1000, drive.now_ns + 10_000 * MS)
    los.add_detections(Detections(ahead, see(pose_vector(drive.X_DU), target.port_tags), ()))
    for _ in range(60):
        _advance(drive, ekf, los, 1)
        seen = los.observe(drive.now_ns, ekf)
    assert seen.status is LosStatus.SEEN
    np.testing.assert_allclose([seen.left, seen.right], edge_bearings(target, drive.X_DU), atol=0.004)


@pytest.mark.parametrize("ahead_ms", [-24.0, 24.0])
def test_edges_are_carried_from_the_exposure_and_not_from_its_stamp(scene: Scene, ahead_ms: float) -> None:
    """The camera's clock is off by what the filter finds: 0.3 rad/s and 24 ms made 7 mrad."""
    given = {"as_built": {"grade": "perfect", "onboard": {"clock_ms": {"sigma": 16.0}}}}
    told = Scene.model_validate({**scene.model_dump(exclude=set(given)), **given}).told()
    target = TargetModel.from_scene(told, told.docks[0])
    ekf, los = CornerEkf(target, told.odometry, corner_sigma_px=0.3), LosEstimator(target)
    drive = make_drive(0, X_DU=SE2(-0.7, 0.0, 0.0), scale_error=0.0)
    drive.speed = lambda X: (0.0, 0.4 * math.cos(2.0 * math.pi * drive.tick / 160.0))
    off = []
    for tick in range(400):
        reading, picture = drive.step()
        ekf.add_odometry(reading)
        if picture is not None:
            stamp_ns = picture.exposure.stamp_ns + round(ahead_ms * MS)
            seen = replace(picture, exposure=replace(picture.exposure, stamp_ns=stamp_ns))
            drive.under_way.append((drive.tick + 12, seen))
        while drive.under_way and drive.under_way[0][0] <= drive.tick:
            detections = drive.under_way.pop(0)[1]
            ekf.add_detections(detections)
            los.add_detections(detections)
        if tick > 200:
            found = los.observe(drive.now_ns, ekf)
            assert found.status is LosStatus.SEEN
            off.append(found.left - edge_bearings(target, drive.X_DU)[0])
    assert ekf.clock_ahead_s == pytest.approx(1e-3 * ahead_ms, abs=2e-3)
    assert float(np.sqrt(np.mean(np.square(off)))) < 2e-3
