"""Least squares over corners, against gradients that numpy computes from the projection's derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from msrr_perception.kernels.corners import WeightedCorners
from msrr_perception.pose.corner_fit import equally_weighted, fit_corners
from msrr_perception.pose.target import TargetModel
from msrr_scenes.messages import TagDetection
from tests.perception.conftest import jacobian, project


def _view(target: TargetModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a pose with tilt drawn by ``rng``, and the corners of the tags of the port."""
    pose = np.array([rng.uniform(-0.8, -0.2), *rng.normal(0.0, [0.03, 0.05, 0.005, 0.005])])
    return pose, np.concatenate([target.corners_D[tag] for tag in target.port_tags])


def _seen(target: TargetModel, pixels: np.ndarray) -> WeightedCorners:
    """Return the pixels of the corners of the tags of the port as measurements of 0.25 px."""
    corners = pixels.reshape(-1, 4, 2)
    tags = [TagDetection(i, c, 50.0, 0) for i, c in zip(target.port_tags, corners, strict=True)]
    return equally_weighted(target, tags, 0.25)


def test_a_fit_ends_where_the_gradient_vanishes(target: TargetModel) -> None:
    """Gradient and covariance are worked out by numpy from the projection and its derivatives."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        pose, points = _view(target, rng)
        pixels = project(target, pose, points)[1].reshape(-1) + rng.normal(0.0, 0.2, 2 * len(points))
        prior = np.diag([1e2, 1e2, 1e2, 4e4, 4e4])
        found = fit_corners(
            target, target.layout, _seen(target, pixels), pose + 0.01, pose, prior, max_iterations=30
        )
        predicted, J = jacobian(found.state, points)
        residual = (pixels - predicted) / 0.25
        H = J.T @ J / 0.25**2 + prior
        gradient = J.T @ residual / 0.25 - prior @ (found.state - pose)
        step = np.linalg.solve(H, gradient)
        assert float(step @ H @ step) < 1e-5
        assert found.chi2 == pytest.approx(float(residual @ residual), rel=1e-9)
        np.testing.assert_allclose(found.covariance @ H, np.eye(5), atol=1e-6)


def test_a_direction_left_open_is_an_error(target: TargetModel) -> None:
    pose, points = _view(target, np.random.default_rng(1))
    pixels = project(target, pose, points)[1].reshape(-1)
    with pytest.raises(np.linalg.LinAlgError, match="open"):
        fit_corners(
            target,
            target.layout,
            _seen(target, pixels),
            np.append(pose, [0.0, 0.0]),
            np.zeros(7),
            np.zeros((7, 7)),  # the last two entries do not show in the image, and nothing else holds them
        )
