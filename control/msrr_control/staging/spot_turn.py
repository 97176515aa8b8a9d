"""Turns on the spot, of units on their own and of those that a base station leads."""

from __future__ import annotations

import math

from msrr_control.staging.parameters import RouteFollowingParams
from msrr_scenes.messages import Twist
from msrr_scenes.specs.vehicle import LimitsSpec

#: Share of the drive's largest turn rate that is used, and the largest rate of any drive [rad/s].
_SHARE, _FASTEST_RADPS = 0.7, 1.0


def spot_turn(
    error: float, params: RouteFollowingParams, limits: LimitsSpec, allowed: float = math.inf
) -> Twist:
    """Return the command that turns a unit on the spot.

    Args:
        error: Angle that is left to turn, counter-clockwise positive [rad].
        params: Parameters of the routes, with the gain.
        limits: What the drive can do.
        allowed: Largest angle by which the unit may turn now [rad].
    """
    fastest = min(_SHARE * limits.w_max_radps, _FASTEST_RADPS)
    return Twist(0.0, math.copysign(min(params.turn_per_s * min(abs(error), allowed), fastest), error))
