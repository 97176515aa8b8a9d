"""The true pose of a docking port before its target, and the zone in which contact is part of docking."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: The zone in front of a port in which contact is part of docking; contact outside it is a collision. The
#: half-width reaches over the mouths of the shipped port, the depth twice the length of the pins.
#: It is at least that of the shipped unit.
_LEAST_ZONE_DEPTH_M = 0.036
#: Largest overlap of the faces in the zone; a larger overlap is inside the target or behind it.
_ZONE_OVERLAP_M = 0.005
_ZONE_HALF_WIDTH_M = 0.05
_ZONE_YAW_RAD = math.radians(20.0)


@dataclass(frozen=True, slots=True)
class PortPose:
    """True pose of the docking port in the dock frame D of the target, at the height of the pins.

    Pitch and roll of both units are allowed for. At 2 deg of relative pitch the faces of a seated pair are
    3 mm apart at the floor.

    Attributes:
        gap: Distance between the two faces along x of D [m], negative when they overlap.
        lateral: Offset from the axis of D, positive to the left [m].
        yaw: Angle to the axis of D [rad].
        zone_depth: Depth of the zone for the pins of the docking unit [m].
    """

    gap: float
    lateral: float
    yaw: float
    zone_depth: float

    @property
    def in_zone(self) -> bool:
        """Whether contact with the target is part of docking at this pose."""
        return is_near_zone(self.gap, self.lateral, self.zone_depth, 0.0) and abs(self.yaw) <= _ZONE_YAW_RAD


def zone_depth(pin_length: float) -> float:
    """Return the depth of the zone for pins of this length, both [m]."""
    return max(_LEAST_ZONE_DEPTH_M, 2.0 * pin_length)


def is_near_zone(gap: float, lateral: float, depth: float, margin: float) -> bool:
    """Return whether a port is in the zone, or no farther from it than ``margin`` [m], whatever its yaw.

    Args:
        gap: Distance between the two faces along x of D [m].
        lateral: Offset from the axis of D [m].
        depth: Depth of the zone [m].
        margin: Distance by which the zone is grown to all sides [m].
    """
    return -_ZONE_OVERLAP_M - margin <= gap <= depth + margin and abs(lateral) <= _ZONE_HALF_WIDTH_M + margin
