"""How uncertain tolerances make the first pose of the corner filter: as far as each error puts it off."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from msrr_perception.estimation.corner_filter import CornerEkf
from msrr_perception.pose.calibration import Tolerances
from msrr_perception.pose.joint_pose import joint_pose
from msrr_perception.pose.target import TargetModel, pose_vector
from msrr_scenes.geometry.pinhole import body_pose, optical_pose
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Detections, Exposure, PoseMeasurement, TagDetection
from msrr_scenes.specs.scene import Scene

X_DU = SE2(-0.6, 0.05, 0.1)
EXPOSURE = Exposure("a/onboard", 0, 0)

#: Errors of a camera's mount that are one standard deviation: x, y, z [m], roll, pitch, yaw [rad].
MOUNT = (0.001, 0.001, 0.001, *[math.radians(0.3)] * 3)

Measure = Callable[[CornerEkf, tuple[TagDetection, ...]], None]


def _by_corners(ekf: CornerEkf, tags: tuple[TagDetection, ...]) -> None:
    ekf.add_detections(Detections(EXPOSURE, tags, ()))


def _by_pose(ekf: CornerEkf, tags: tuple[TagDetection, ...]) -> None:
    pose = joint_pose(ekf.target, tags)
    assert pose is not None
    ekf.add_pose(PoseMeasurement(EXPOSURE, pose.X_DU, 1e-8 * np.eye(3), (None, None)))


@pytest.mark.parametrize("measure", [_by_corners, _by_pose])
@pytest.mark.parametrize("error", range(6), ids=["x", "y", "z", "roll", "pitch", "yaw"])
def test_one_error_of_the_mount_is_one_deviation_of_the_first_pose(
    target: TargetModel, scene: Scene, project: Callable[..., Any], error: int, measure: Measure
) -> None:
    """The camera is off by one standard deviation, and what that adds to the covariance is its square.

    An error of 0.3 deg acts to second order, too: a hundredth of a deviation is left for that.
    """
    mount = np.where(np.arange(6) == error, MOUNT, 0.0)
    X_BX = SE3.from_xyz_rpy(mount[:3].tolist(), mount[3:].tolist())
    built = replace(target, X_UC=optical_pose(body_pose(target.X_UC) @ X_BX))
    tags = tuple(
        TagDetection(i, project(built, pose_vector(X_DU), built.corners_D[i])[1]) for i in target.port_tags
    )
    told = replace(target, tolerances=replace(target.tolerances, camera=tuple(mount.tolist())))
    assert target.tolerances == Tolerances()
    estimates = []
    for of in (told, target):
        ekf = CornerEkf(of, scene.odometry)
        measure(ekf, tags)
        estimate = ekf.estimate(0)
        assert estimate is not None
        estimates.append(estimate)
    off = estimates[0].X_DU.as_array() - X_DU.as_array()
    added = estimates[0].covariance - estimates[1].covariance
    sigmas = np.sqrt(np.diag(added))
    assert np.linalg.norm(off) > 2e-4
    np.testing.assert_allclose(sigmas, np.abs(off), atol=0.01 * np.abs(off).max())
    np.testing.assert_allclose(added, np.outer(off, off), atol=0.02 * np.square(off).max())
