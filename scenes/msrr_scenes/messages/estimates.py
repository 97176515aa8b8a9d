"""What perception makes of it: poses, the line of sight, the situation in the arena."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.sensing import GlobalPose


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """A filtered planar pose.

    Attributes:
        stamp_ns: The time that the estimate speaks of (the last exposure when delay compensation is off).
        X_DU: The unit in the dock frame D of its target (x into the docked unit).
        covariance: Of (x, y, yaw) in D, shape (3, 3) [m, rad].
        last_seen_ns: Exposure time of the last measurement that passed the gate.
    """

    stamp_ns: int
    X_DU: SE2
    covariance: Array
    last_seen_ns: int


class LosStatus(Enum):
    """How the line-of-sight angles of the target came about."""

    SEEN = "seen"
    PREDICTED = "predicted"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class LosObservation:
    """Line of sight to the docking target.

    Attributes:
        stamp_ns: Time the angles speak of.
        left: Angle from the camera's axis to the target's left edge, counter-clockwise positive [rad].
        right: The same for the right edge [rad].
        margin: Smallest distance of a seen edge to the border of the field of view [rad]; negative: outside.
        status: Measured in the image, predicted by the filter, or lost.
    """

    stamp_ns: int
    left: float
    right: float
    margin: float
    status: LosStatus


@dataclass(frozen=True, slots=True, eq=False)
class ObstacleEstimate:
    """An obstacle known by its detected tag.

    Attributes:
        name: Which one, by the map from tag ids to kinds of obstacles.
        stamp_ns: Exposure time of the last sight of it.
        X_WB: Its middle on the floor.
        covariance: Of (x, y, yaw) in W, shape (3, 3) [m, rad].
        radius: Radius of the circle about its footprint [m].
    """

    name: str
    stamp_ns: int
    X_WB: SE2
    covariance: Array
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class ArenaEstimate:
    """What global localisation knows at one instant; everything in the world frame W.

    Attributes:
        stamp_ns: The time that ``own`` speaks of (the last exposure when delay compensation is off).
        own: The docking unit's frame U.
        target: Frame U of the unit it docks to.
        others: Frames U of the remaining units that have been seen.
        obstacles: Every obstacle that has been seen.
        last_seen_ns: Exposure time of the last sight of the docking unit itself.
    """

    stamp_ns: int
    own: GlobalPose
    target: GlobalPose
    others: tuple[GlobalPose, ...]
    obstacles: tuple[ObstacleEstimate, ...]
    last_seen_ns: int
