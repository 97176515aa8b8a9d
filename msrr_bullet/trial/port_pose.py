"""The true pose of a docking port before its target, and the zone in which contact is part of docking."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: The zone in front of a port in which contact is part of docking; contact outside it is a collision. The
#: half-width is half the face of the port, the depth twice the length of the pins.
_ZONE_DEPTH_M = 0.036
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
    """

    gap: float
    lateral: float
    yaw: float

    @property
    def in_zone(self) -> bool:
        """Whether contact with the target is part of docking at this pose."""
        return is_near_zone(self.gap, self.lateral, 0.0) and abs(self.yaw) <= _ZONE_YAW_RAD


def is_near_zone(gap: float, lateral: float, margin: float) -> bool:
    """Return whether a port is in the zone, or no farther from it than ``margin`` [m], whatever its yaw.

    Args:
        gap: Distance between the two faces along x of D [m].
        lateral: Offset from the axis of D [m].
        margin: Distance by which the zone is grown to all sides [m].
    """
    return (
        -_ZONE_OVERLAP_M - margin <= gap <= _ZONE_DEPTH_M + margin
        and abs(lateral) <= _ZONE_HALF_WIDTH_M + margin
    )
