"""The gate before the fit, against numpy; the fit itself is tested beside ``pose/corner_fit``."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from msrr_perception.kernels.corners import gate_distances
from msrr_perception.pose.corner_fit import equally_good
from msrr_perception.pose.target import TargetModel
from msrr_scenes.messages import TagDetection


def test_the_gate_measures_mahalanobis_distances(target: TargetModel, jacobian: Callable) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        pose = np.array([rng.uniform(-0.8, -0.2), *rng.normal(0.0, [0.03, 0.05, 0.005, 0.005])])
        points = np.concatenate([target.corners_D[tag] for tag in target.port_tags])
        A = rng.normal(0.0, 0.003, (7, 7))
        P, state = A @ A.T, np.append(pose, [0.01, -0.01])
        predicted, J = jacobian(pose, points)
        pixels = predicted + rng.normal(0.0, 1.0, len(predicted))
        corners = pixels.reshape(-1, 4, 2)
        tags = [TagDetection(i, c, 50.0, 0) for i, c in zip(target.port_tags, corners, strict=True)]
        seen = equally_good(target.layout, tags, 0.25)
        found = gate_distances(target.optics, target.layout.tags, seen, state, P)
        for tag in range(len(found)):
            rows = slice(8 * tag, 8 * tag + 8)
            S = J[rows] @ P[:5, :5] @ J[rows].T + 0.25**2 * np.eye(8)
            r = (pixels - predicted)[rows]
            assert found[tag] == pytest.approx(float(r @ np.linalg.solve(S, r)), rel=1e-6)
