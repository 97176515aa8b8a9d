"""The lane of a port: the strip of ground that a unit covers as it docks."""

from __future__ import annotations

import math
from collections.abc import Iterable

from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate

#: Gap to an obstacle beside the lane of a port below which nobody docks [m]; the collision monitor keeps it.
LANE_GAP_M = 0.03


def in_lane(
    X_WD: SE2,
    length: float,
    half_width: float,
    obstacles: Iterable[ObstacleEstimate],
    gap: float = LANE_GAP_M,
) -> str | None:
    """Return the name of an obstacle in the lane of a port, None if the lane is free.

    Args:
        X_WD: Dock frame of the port.
        length: Length of the lane before the port [m].
        half_width: Half the width of the body that docks [m].
        obstacles: Obstacles.
        gap: Gap between body and obstacle below which the obstacle counts [m].
    """
    for obstacle in obstacles:
        X_DO = X_WD.inverse() @ obstacle.X_WB
        before, beside = max(X_DO.x, 0.0), max(abs(X_DO.y) - half_width, 0.0)
        if X_DO.x > -length and math.hypot(before, beside) < obstacle.radius + gap:
            return obstacle.name
    return None
