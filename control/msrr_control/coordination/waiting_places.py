"""Places where a unit waits in nobody's way."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from msrr_control.coordination.ledger import UnitRecord
from msrr_control.planning.free_space import Bounds
from msrr_control.shapes.precedence import Lanes
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate

#: Distance of a waiting place from lanes, tracks and units [m], and the grid of such places [m].
WAITING_ROOM_M, _GRID_M = 0.36, 0.25


def waiting_places(
    lanes: Lanes,
    box: Bounds,
    docked: Iterable[SE2],
    units: Iterable[UnitRecord],
    obstacles: Iterable[ObstacleEstimate],
) -> Array:
    """Return the points of a grid, shape (N, 2) [m], that are far enough from whatever is in use.

    The lanes of the poses ``docked``, at the ends of the open tasks, stay free. Units and obstacles have been
    seen, and the unit that looks for a place is one of them. Units may be and are seen in ``box``.
    """
    x0, x1, y0, y1 = box
    edge = lanes.spec.border_m + lanes.body.offset
    xs = np.arange(x0 + edge, x1 - edge + 1e-9, _GRID_M)
    ys = np.arange(y0 + edge, y1 - edge + 1e-9, _GRID_M)
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    back = np.linspace(0.0, lanes.length, 8)
    lane = np.stack([-back, np.zeros_like(back)], axis=-1)
    keep: list[Array] = [X_WE.act(lane) for X_WE in docked]
    for unit in units:
        keep.append(unit.pose.translation[None])
        if (unit.under_way or unit.may_go_on) and unit.track is not None:
            keep.append(unit.track.poses[:, :2])
    taken = np.concatenate(keep) if keep else np.zeros((0, 2))
    apart = np.hypot(*np.moveaxis(points[:, None] - taken[None], -1, 0)).min(axis=1, initial=math.inf)
    for obstacle in obstacles:
        larger = max(obstacle.radius - lanes.body.radius, 0.0)  # it counts as large as a unit at least
        apart = np.minimum(apart, np.hypot(*(points - obstacle.X_WB.translation).T) - larger)
    free: Array = points[apart > WAITING_ROOM_M]
    return free
