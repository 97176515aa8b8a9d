"""The lane of a port: an obstacle is in it if a body that docks would come too near to it."""

from __future__ import annotations

import math

import numpy as np

from msrr_control.planning.lane import LANE_GAP_M, in_lane
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate

LENGTH, HALF_WIDTH = 0.7, 0.1


def _obstacle(X_WO: SE2, radius: float) -> ObstacleEstimate:
    return ObstacleEstimate("post", 0, X_WO, np.zeros((3, 3)), radius)


def test_the_lane_is_what_the_front_of_the_body_covers() -> None:
    """The front drives to the face of the port; what is nearest to an obstacle there decides."""
    rng = np.random.default_rng(0)
    front = np.linspace([0.0, -HALF_WIDTH], [0.0, HALF_WIDTH], 201)
    found = []
    for _ in range(300):
        X_WD, radius = SE2(*rng.uniform(-3.0, 3.0, 3)), rng.uniform(0.02, 0.3)
        X_DO = SE2(rng.uniform(-1.2, 0.5), rng.uniform(-0.6, 0.6), rng.uniform(-3.0, 3.0))
        back = max(min(X_DO.x, 0.0), -LENGTH)  # where the front is nearest to the obstacle
        gap = np.hypot(front[:, 0] + back - X_DO.x, front[:, 1] - X_DO.y).min() - radius
        if abs(gap - LANE_GAP_M) < 2e-3:
            continue
        closed = bool(gap < LANE_GAP_M and X_DO.x > -LENGTH)
        assert (in_lane(X_WD, LENGTH, HALF_WIDTH, [_obstacle(X_WD @ X_DO, radius)]) == "post") is closed
        found.append(closed)
    assert 50 < sum(found) < 250


def test_what_is_behind_the_unit_does_not_close_its_lane() -> None:
    X_WD, behind = SE2(1.0, 0.5, math.pi / 3.0), SE2(-0.5, 0.0, 0.0)
    obstacles = [_obstacle(X_WD @ behind, 0.05)]
    assert in_lane(X_WD, 0.6, HALF_WIDTH, obstacles) == "post"
    assert in_lane(X_WD, 0.4, HALF_WIDTH, obstacles) is None
    assert in_lane(X_WD, 0.6, HALF_WIDTH, []) is None
