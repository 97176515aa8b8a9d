"""Motions without a route: turns on the spot, and ways straight back or ahead."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_control.staging.parameters import RouteFollowingParams
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages import Twist
from msrr_scenes.specs.vehicle import LimitsSpec

#: Share of the drive's largest turn rate that is used, and the largest rate of any drive [rad/s].
_SHARE, _FASTEST_RADPS = 0.7, 1.0

#: Speed of a straight way [m/s], its gain [1/s], and the distance from its end at which it is over [m].
_STRAIGHT_MPS, _STRAIGHT_PER_S, _THERE_M = 0.1, 2.0, 0.01

#: Time that a straight way may take beyond the one that it takes at full speed [s].
_SPARE_S = 3.0


def spot_turn(
    error: float, params: RouteFollowingParams, limits: LimitsSpec, allowed: float = math.inf
) -> Twist:
    """Return the command that turns a unit on the spot by ``error`` [rad], counter-clockwise positive.

    ``allowed`` is the largest angle by which it may turn now [rad].
    """
    fastest = min(_SHARE * limits.w_max_radps, _FASTEST_RADPS)
    return Twist(0.0, math.copysign(min(params.turn_per_s * min(abs(error), allowed), fastest), error))


@dataclass(frozen=True, slots=True)
class StraightDrive:
    """A way straight ahead or back.

    Attributes:
        X_WS: Pose of the unit at its start.
        distance: Its length, ahead > 0, back < 0 [m].
    """

    X_WS: SE2
    distance: float

    def longest_s(self, limits: LimitsSpec) -> float:
        """Return the time after which something holds the unit on its way [s]."""
        return abs(self.distance) / _fastest(limits) + _SPARE_S

    def step(self, X_WU: SE2, limits: LimitsSpec) -> Twist | None:
        """Return the command of a unit at ``X_WU``; None at the end of the way."""
        left = self.distance - (self.X_WS.inverse() @ X_WU).x
        if abs(left) < _THERE_M:
            return None
        return Twist(math.copysign(min(_STRAIGHT_PER_S * abs(left), _fastest(limits)), left), 0.0)


def _fastest(limits: LimitsSpec) -> float:
    return min(_STRAIGHT_MPS, limits.v_max_mps)
