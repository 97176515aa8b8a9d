"""The projection and its derivatives against the chain of frames, and the tags that are expected in view."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.kernels.project import predict_tags
from msrr_perception.pose.target import TargetModel
from msrr_scenes.geometry.se2 import SE2
from tests.perception.conftest import jacobian, project


def _poses(n: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    lo, hi = [-0.9, -0.2, -0.4, -0.05, -0.05], [-0.15, 0.2, 0.4, 0.05, 0.05]
    return rng.uniform(lo, hi, (n, 5))


@pytest.mark.parametrize("camera", ["target", "leaning"])
def test_pixels_equal_the_chain_of_frames_and_derivatives_equal_central_differences(
    camera: str, request: pytest.FixtureRequest
) -> None:
    by: TargetModel = request.getfixturevalue(camera)
    points = np.concatenate([by.corners_D[t] for t in by.port_tags])
    h = 1e-6
    for pose in _poses(50):
        pixels, J = jacobian(pose, points, by)
        np.testing.assert_allclose(pixels.reshape(-1, 2), project(by, pose, points)[1], atol=1e-9)
        for i in range(5):
            step = h * np.eye(5)[i]
            numeric = (jacobian(pose + step, points, by)[0] - jacobian(pose - step, points, by)[0]) / (
                2.0 * h
            )
            np.testing.assert_allclose(J[:, i], numeric, rtol=1e-5, atol=1e-3)


def test_points_behind_the_camera_stay_finite(target: TargetModel) -> None:
    pixels, J = jacobian(np.array([1.0, 0.0, 0.0, 0.0, 0.0]), target.corners_D[target.port_tags[0]])
    assert np.all(np.isfinite(pixels))
    assert np.all(np.isfinite(J))


def test_tags_are_expected_where_they_can_be_read(target: TargetModel) -> None:
    rng, camera = np.random.default_rng(3), target.camera
    counts = {True: 0, False: 0}
    for _ in range(200):
        X_DU = SE2(rng.uniform(-0.9, 0.1), rng.normal(0.0, 0.15), rng.normal(0.0, 0.4))
        pose = np.append(X_DU.as_array(), [0.0, 0.0])
        A = rng.normal(0.0, 0.01, (3, 3))
        pixels, sigma, expected = predict_tags(
            target.optics, camera.width, camera.height, pose, A @ A.T, target.all_corners_D, 10.0
        )
        for i, corners in enumerate(target.all_corners_D):
            p_C, places = project(target, pose, corners)
            normal = np.cross(p_C[1] - p_C[0], p_C[0] - p_C[3])
            edges = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
            fits = (
                p_C[:, 2].min() >= 0.01
                and normal @ p_C[0] > 0.0
                and camera.contains(places).all()
                and edges.min() >= 10.0
            )
            assert bool(expected[i]) == bool(fits)
            counts[bool(fits)] += 1
            if fits:
                J = jacobian(pose, corners)[1][:, :3]
                variance = np.diag(J @ A @ A.T @ J.T).reshape(4, 2)
                np.testing.assert_allclose(pixels[i], places, atol=1e-8)
                np.testing.assert_allclose(sigma[i], np.sqrt(variance), rtol=1e-6)
    assert min(counts.values()) > 100
