"""How near the end of its route the base station has to see a unit for the unit to have arrived."""

from __future__ import annotations

import math
from typing import NamedTuple

from msrr_scenes.geometry.se2 import SE2, wrap_angle


class GoalTolerance(NamedTuple):
    """Largest errors of the pose at the goal, as Nav2's goal checkers have them.

    The defaults are those of a base station that sees units where they are: what a unit leaves over when it
    comes to rest, and noise.

    Attributes:
        xy_m: Largest distance from the goal [m].
        yaw_rad: Largest heading error [rad].
    """

    xy_m: float = 0.03
    yaw_rad: float = 0.05

    def widened(self, xy_m: float, yaw_rad: float) -> GoalTolerance:
        """Return the tolerance for units that are seen with these errors of place and heading."""
        return GoalTolerance(self.xy_m + xy_m, self.yaw_rad + yaw_rad)

    def doubled(self) -> GoalTolerance:
        """Return a tolerance of twice the size."""
        return GoalTolerance(2.0 * self.xy_m, 2.0 * self.yaw_rad)

    def holds(self, X_GU: SE2) -> bool:
        """Return whether a unit U is at the goal G."""
        return math.hypot(X_GU.x, X_GU.y) <= self.xy_m and abs(wrap_angle(X_GU.yaw)) <= self.yaw_rad


#: Tolerance of a base station that sees units where they are.
DEFAULT_TOLERANCE = GoalTolerance()
