"""How far the controlled point of a unit keeps from the border, from other units and from obstacles."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from msrr_control.path_following.walls import WallSpec
from msrr_control.planning.free_space import Bounds, Disc, FreeSpace
from msrr_control.planning.route import ArenaMap, RouteSpec
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import ObstacleEstimate

#: Distance between the points of a path that are checked for being free [m].
SPACING_M = 0.04

#: Ways straight back and ahead that are tried where a unit has no room to turn on the spot [m]. Back comes
#: first: the unit has most probably come from there.
_STRAIGHT_M = (0.0, *(sign * 0.05 * n for n in range(1, 11) for sign in (-1.0, 1.0)))


class Margins:
    """The margins of one unit, and the space that they leave to its controlled point."""

    def __init__(
        self,
        spec: RouteSpec,
        walls: WallSpec,
        box: Bounds,
        offset: float,
        body_half_width: float,
    ) -> None:
        """Take margins and geometry, as :class:`msrr_control.planning.route_planner.RoutePlanner` does."""
        x0, x1, y0, y1 = box
        b = spec.border_m
        self._box = (x0 + b, x1 - b, y0 + b, y1 - b)
        self._spec, self._walls = spec, walls
        self._offset, self._half_width = offset, body_half_width

    def may_drive_ahead(self, X_WU: SE2, obstacles: Iterable[ObstacleEstimate], distance: float) -> bool:
        """Return whether border and obstacles let a unit drive straight ahead by ``distance`` [m]."""
        ahead = np.linspace(0.0, self._offset + distance, 2 + math.ceil(distance / SPACING_M))
        space = FreeSpace(self._box, tuple(map(self.obstacle_disc, obstacles))).opened_at(X_WU.x, X_WU.y)
        return space.allows(X_WU.act(np.stack([ahead, np.zeros_like(ahead)], axis=-1)))

    def inwards(self, X_WU: SE2) -> float | None:
        """Return the direction away from the border [rad]; None where the unit has room to face anywhere."""
        x0, x1, y0, y1 = self._box
        dx = min(max(X_WU.x, x0 + self._offset), x1 - self._offset) - X_WU.x
        dy = min(max(X_WU.y, y0 + self._offset), y1 - self._offset) - X_WU.y
        return math.atan2(dy, dx) if dx or dy else None

    def way_to_turn(self, arena: ArenaMap, radius: float) -> float | None:
        """Return the shortest way straight to where the unit may turn on the spot: back < 0, ahead > 0 [m].

        ``radius`` is that of the circle that the unit covers when it turns on the spot [m].

        Returns:
            0 where the unit may turn already; None if no place within reach lets it turn.
        """
        bodies = (*arena.units, *(Disc(o.name, o.X_WB.x, o.X_WB.y, o.radius) for o in arena.obstacles))
        beside, around = (
            FreeSpace(self._box, tuple(b._replace(radius=b.radius + reach) for b in bodies))
            for reach in (self._half_width + self._walls.margin_m, radius + self._walls.margin_m)
        )
        beside = beside.opened_at(arena.X_WU.x, arena.X_WU.y)
        for distance in _STRAIGHT_M:
            way = arena.X_WU.act(np.stack([np.linspace(0.0, distance, 10), np.zeros(10)], axis=-1))
            if around.allows(way[-1:]) and beside.allows(way):
                return distance
        return None

    def unit_disc(self, disc: Disc) -> Disc:
        """Return the disc that the controlled point keeps out of because of another unit."""
        return disc._replace(radius=disc.radius + self._half_width + self._spec.unit_margin_m)

    def obstacle_disc(self, obstacle: ObstacleEstimate) -> Disc:
        """Return the disc that the controlled point keeps out of when it drives past an obstacle."""
        radius = obstacle.radius + self._half_width + self._walls.margin_m
        return Disc(obstacle.name, obstacle.X_WB.x, obstacle.X_WB.y, radius)

    def around_disc(self, obstacle: ObstacleEstimate, margin: float) -> Disc:
        """Return the disc that the controlled point keeps out of when it drives around an obstacle.

        While the controlled point drives an arc of radius R, the axle, l behind it, cuts the corner: it
        drives one of radius sqrt(R^2 - l^2).
        """
        disc = self.obstacle_disc(obstacle)
        return disc._replace(radius=math.hypot(disc.radius + margin, self._offset))

    def free_space(self, arena: ArenaMap, obstacles: Iterable[Disc] = ()) -> FreeSpace:
        """Return the space without the discs of the other units and of the given obstacles."""
        discs = (*map(self.unit_disc, arena.units), *obstacles)
        return FreeSpace(self._box, discs).opened_at(arena.X_WU.x, arena.X_WU.y)
