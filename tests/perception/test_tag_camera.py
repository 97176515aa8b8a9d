from __future__ import annotations

import numpy as np

from msrr_perception.pose.tag_camera import project, project_with_jacobian
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se3 import SE3


def _poses(n: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    lo, hi = [-0.9, -0.2, -0.4, -0.05, -0.05], [-0.15, 0.2, 0.4, 0.05, 0.05]
    return rng.uniform(lo, hi, (n, 5))


def test_projection_is_the_chain_of_frames(target: TargetModel) -> None:
    points = np.concatenate([target.corners_D[t] for t in target.port_tags])
    for x, y, yaw, pitch, roll in _poses(50):
        X_DU = SE3.from_xyz_rpy([x, y, 0.0], [roll, pitch, yaw])
        p_C = (target.X_CU @ X_DU.inverse()).act(points)
        found, pixels = project(target, np.array([x, y, yaw, pitch, roll]), points)
        np.testing.assert_allclose(found, p_C, atol=1e-12)
        front = p_C[:, 2] > 0.02
        np.testing.assert_allclose(pixels[front], target.camera.project(p_C[front]), atol=1e-8)


def test_derivatives_equal_central_differences(target: TargetModel) -> None:
    points = np.concatenate([target.corners_D[t] for t in target.port_tags])
    h = 1e-6
    for pose in _poses(50):
        pixels, J = project_with_jacobian(target, pose, points)
        np.testing.assert_allclose(pixels.reshape(-1, 2), project(target, pose, points)[1], atol=1e-9)
        for i in range(5):
            step = h * np.eye(5)[i]
            ahead = project_with_jacobian(target, pose + step, points)[0]
            behind = project_with_jacobian(target, pose - step, points)[0]
            numeric = (ahead - behind) / (2.0 * h)
            np.testing.assert_allclose(J[:, i], numeric, rtol=1e-5, atol=1e-3)


def test_points_behind_the_camera_stay_finite(target: TargetModel) -> None:
    pixels, J = project_with_jacobian(
        target, np.array([1.0, 0.0, 0.0, 0.0, 0.0]), target.corners_D[target.port_tags[0]]
    )
    assert np.all(np.isfinite(pixels))
    assert np.all(np.isfinite(J))
