"""The true pose of a docking port before its target, and the zone in which contact is part of docking."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_scenes.geometry.pin_and_hole import PinAndHole

#: Depth of the zone in lengths of the pins, and its half-width beyond the edges of the mouths [m]: pins that
#: press on the face beside them are part of docking.
_PIN_LENGTHS, _BESIDE_M = 2.0, 0.035
#: Depth and half-width of the zone of a small mechanism, at least [m].
_LEAST_DEPTH_M, _LEAST_HALF_WIDTH_M = 0.036, 0.05
#: Largest overlap of the faces in the zone; a larger overlap is inside the target or behind it.
_OVERLAP_M = 0.005
_YAW_RAD = math.radians(20.0)


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


@dataclass(frozen=True, slots=True)
class DockingZone:
    """The zone in front of a port in which contact is part of docking; contact outside it is a collision.

    ``depth`` is the largest gap between the faces, and ``half_width`` the largest lateral offset [m].
    """

    depth: float
    half_width: float

    @classmethod
    def of(cls, mechanism: PinAndHole) -> DockingZone:
        """Return the zone of a pair of ports."""
        return cls(
            max(_LEAST_DEPTH_M, _PIN_LENGTHS * mechanism.pin_length),
            max(_LEAST_HALF_WIDTH_M, mechanism.mouth + _BESIDE_M),
        )

    def __contains__(self, port: PortPose) -> bool:
        """Return whether contact with the target is part of docking at this pose."""
        return self.is_near(port.gap, port.lateral, 0.0) and abs(port.yaw) <= _YAW_RAD

    def is_near(self, gap: float, lateral: float, margin: float) -> bool:
        """Return whether a port is in the zone, or no farther from it than ``margin`` [m], whatever its yaw.

        Gap and lateral offset are those of a :class:`PortPose`.
        """
        return -_OVERLAP_M - margin <= gap <= self.depth + margin and abs(lateral) <= self.half_width + margin
