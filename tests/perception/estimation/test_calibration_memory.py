"""What a unit learns of its calibration and of ports from corners that are not where the drawing has them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from msrr_perception.estimation.calibration_memory import CalibrationMemory
from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.estimation.dock_frame import pose_in_D
from msrr_perception.motion.filter_state import CalibrationEstimate, FilterState
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Detections, Exposure, PoseMeasurement
from msrr_scenes.specs.scene import Scene
from tests.conftest import not_none
from tests.perception.conftest import see, see_target

SEATED = SE2(-0.1, 0.0, 0.0)


def _target(scene: Scene) -> TargetModel:
    return TargetModel.from_scene(scene.told(), scene.docks[0])


def _looks(ekf: CornerEkf, pose: np.ndarray, frames: int, first: int = 0) -> None:
    for frame in range(first, first + frames):
        tags = see(pose, ekf.target.port_tags)
        ekf.add_detections(Detections(Exposure("a/onboard", frame, frame * 40_000_000), tags, ()))


def test_a_port_looks_from_its_seat_as_it_did_the_last_time(careful: Scene) -> None:
    """The bracket holds the marker 2 mm and 0.5 deg off, so that by the drawing the unit is not seated."""
    target = _target(careful)
    seen = np.array([-0.1 - 0.002, 0.001, math.radians(0.5), 0.0, 0.0])
    first = CornerEkf(target, careful.odometry)
    _looks(first, seen, 10)
    before = not_none(first.estimate(360_000_000))
    assert abs(before.X_DU.x - SEATED.x) > 0.0015
    learned = not_none(first.learned(seated=True))
    again = CornerEkf(target, careful.odometry)
    again.recall(learned)
    _looks(again, seen, 10)
    after = not_none(again.estimate(360_000_000))
    assert abs(after.X_DU.x - SEATED.x) < 2e-4
    assert abs(after.X_DU.yaw) < math.radians(0.2)
    assert after.covariance[0, 0] < 0.25 * before.covariance[0, 0]
    assert after.covariance[1, 1] > (0.0006) ** 2  # the play of the throat hides the side


def test_a_seat_with_more_play_says_less_of_the_side(careful: Scene) -> None:
    target = _target(careful)
    assert target.mechanism is not None
    sides = []
    for play in (0.0005, 0.0015, 0.006):
        filter_ = CornerEkf(replace(target, mechanism=replace(target.mechanism, play=play)), careful.odometry)
        _looks(filter_, np.array([-0.1, 0.0, 0.0, 0.0, 0.0]), 10)
        learned = not_none(filter_.learned(seated=True))
        sides.append(math.sqrt(learned.covariance[-2, -2]))  # of the marker on its bracket
    assert 1.02 * sides[0] < sides[1] < sides[2] / 1.02


def test_what_is_learned_of_the_unit_holds_at_another_port(careful: Scene) -> None:
    prior = CornerEkf(_target(careful), careful.odometry).prior
    rng = np.random.default_rng(0)
    A = rng.normal(size=prior.covariance.shape)
    learned = CalibrationEstimate(rng.normal(size=len(prior.mean)), A @ A.T, prior.shared)
    memory = CalibrationMemory()
    assert memory.recall("b.rear", prior) is prior
    memory.keep("b.rear", learned)
    assert memory.recall("b.rear", prior) is learned
    other = memory.recall("c.left", prior)
    own, theirs = prior.shared, np.setdiff1d(np.arange(len(prior.mean)), prior.shared)
    np.testing.assert_array_equal(other.mean[own], learned.mean[own])
    np.testing.assert_array_equal(other.mean[theirs], prior.mean[theirs])
    np.testing.assert_array_equal(other.covariance[np.ix_(own, own)], learned.covariance[np.ix_(own, own)])
    assert not other.covariance[np.ix_(own, theirs)].any()
    assert np.linalg.eigvalsh(other.covariance)[0] > 0.0


def test_the_pose_in_the_dock_frame_moves_with_the_marker(careful: Scene) -> None:
    """Against a chain of poses, and its derivatives by central differences."""
    layout = _target(careful).filter_layout
    assert layout.marker is not None
    rng = np.random.default_rng(1)
    mean = 0.1 * rng.normal(size=layout.size)

    def pose(m: np.ndarray) -> np.ndarray:
        return pose_in_D(layout, FilterState(0, m, np.eye(layout.size), None, 0))[0].as_array()

    px, py, _ = layout.tags.pivot
    mx, my, turn = mean[layout.marker :]
    X = SE2(px + mx, py + my, turn) @ SE2(-px, -py, 0.0) @ SE2(*mean[:3])
    np.testing.assert_allclose(pose(mean), X.as_array(), atol=1e-12)
    J = pose_in_D(layout, FilterState(0, mean, np.eye(layout.size), None, 0))[1]
    for i in range(layout.size):
        e = 1e-6 * np.eye(layout.size)[i]
        np.testing.assert_allclose(J[:, i], (pose(mean + e) - pose(mean - e)) / 2e-6, atol=1e-8)


def test_tolerances_make_a_pose_as_uncertain_as_it_is(scene: Scene, careful: Scene) -> None:
    """As many frames as one likes do not tell where the bracket holds the marker."""
    target, exact = _target(careful), _target(scene)
    pose = np.array([-0.3, 0.0, 0.0, 0.0, 0.0])
    sigmas = []
    for of in (target, exact):
        ekf = CornerEkf(of, careful.odometry)
        _looks(ekf, pose, 100)
        found = not_none(ekf.estimate(99 * 40_000_000))
        sigmas.append(np.sqrt(np.diag(found.covariance)))
    x, y, _, _, _, yaw = target.tolerances.bracket
    assert (sigmas[0] > [x, y, yaw]).all()
    assert (sigmas[1] < [1e-3, 1e-3, 1e-3]).all()


def test_measured_poses_share_the_errors_of_calibration_with_corners(careful: Scene) -> None:
    """However often a pose is measured, what camera and bracket are off by stays unknown.

    Corners tell a little of it, because no pose fits them quite; a pose that is measured tells nothing.
    """
    target, pose = _target(careful), np.array([-0.3, 0.0, 0.0, 0.0, 0.0])
    by_corners, by_poses = CornerEkf(target, careful.odometry), CornerEkf(target, careful.odometry)
    _looks(by_corners, pose, 100)
    for frame in range(100):
        exposure = Exposure("a/onboard", frame, frame * 40_000_000)
        by_poses.add_pose(PoseMeasurement(exposure, SE2(-0.3, 0.0, 0.0), 1e-10 * np.eye(3), (None, None)))
    sigmas = []
    for ekf in (by_corners, by_poses):
        found = not_none(ekf.estimate(99 * 40_000_000))
        sigmas.append(np.sqrt(np.diag(found.covariance)))
    assert (sigmas[0] < sigmas[1]).all()
    assert (sigmas[1] < 2.0 * sigmas[0]).all()


def test_errors_of_the_encoders_are_left_out_of_those_of_the_drive(careful: Scene) -> None:
    """What was learned of a radius is split by the variances of both: a drawing's and an encoder's."""
    target = _target(careful)
    ekf = CornerEkf(target, careful.odometry)
    mean = np.array(ekf.prior.mean)
    mean[:3] = 0.004, -0.002, 0.003
    ekf.recall(CalibrationEstimate(mean, ekf.prior.covariance, ekf.prior.shared))
    of_encoder = careful.odometry.scale_error**2
    left, right, _ = np.square(target.tolerances.wheels)
    shares = left / (left + of_encoder), right / (right + of_encoder), 1.0  # encoders tell nothing of a track
    assert 0.05 < min(shares) < 0.95
    np.testing.assert_allclose(ekf.drive_errors(), np.array(shares) * mean[:3], rtol=1e-9)


def test_a_unit_whose_camera_was_knocked_since_it_learned_starts_by_the_drawing(careful: Scene) -> None:
    """By what it had learned the tags could not be where they were: it never had a pose again."""
    target = _target(careful)
    ekf = CornerEkf(target, careful.odometry)
    ekf.recall(replace(ekf.prior, covariance=0.02 * ekf.prior.covariance))
    pitched = SE3.from_xyz_rpy([0.0, 0.0, 0.0], [math.radians(0.6), 0.0, 0.0])
    knocked, X = replace(target, X_UC=target.X_UC @ pitched), SE2(-0.6, 0.02, 0.05)
    tags = see_target(knocked, pose_vector(X), target.port_tags)
    ekf.add_detections(Detections(Exposure("a/onboard", 0, 0), tags, ()))
    found = not_none(ekf.estimate(0))
    e = found.X_DU.as_array() - X.as_array()
    assert float(e @ np.linalg.solve(found.covariance, e)) < 16.3
