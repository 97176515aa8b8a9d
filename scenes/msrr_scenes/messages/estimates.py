"""Messages of perception: estimated poses, the line of sight, and the bodies in the arena."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.messages.sensing import GlobalPose


@dataclass(frozen=True, slots=True)
class ExposureCounts:
    """What a filter did with the exposures that it was given since it was reset.

    A filter of which the model holds rejects hardly any. Many rejected ones tell of an error that it does not
    know, even where its poses are good.

    Attributes:
        used: Those that agreed, within the gate, with the state, and corrected it; and the first one.
        without_wheels: Those that agreed only if what the wheels tell was doubted.
        rejected: Those that did not agree, and changed nothing but that the filter may have begun anew.
    """

    used: int = 0
    without_wheels: int = 0
    rejected: int = 0

    @property
    def total(self) -> int:
        """Number of exposures."""
        return self.used + self.without_wheels + self.rejected

    @property
    def disagreeing(self) -> float:
        """Share of the exposures that did not agree with state and wheels; 0 without any."""
        return (self.without_wheels + self.rejected) / max(self.total, 1)

    def __add__(self, other: ExposureCounts) -> ExposureCounts:
        return ExposureCounts(
            self.used + other.used,
            self.without_wheels + other.without_wheels,
            self.rejected + other.rejected,
        )

    def since(self, earlier: ExposureCounts) -> ExposureCounts:
        """Return what was added to earlier counts of the same filter, which may have been reset meanwhile."""
        added = ExposureCounts(
            self.used - earlier.used,
            self.without_wheels - earlier.without_wheels,
            self.rejected - earlier.rejected,
        )
        return self if min(added.used, added.without_wheels, added.rejected) < 0 else added


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """A filtered planar pose.

    Attributes:
        stamp_ns: Time of the pose (of the last exposure when delay compensation is off).
        X_DU: Pose of the unit in the dock frame D of its target (x into the docked unit).
        covariance: Covariance of (x, y, yaw) in D, shape (3, 3) [m, rad].
        last_seen_ns: Exposure time of the last measurement that passed the gate.
        exposures: What became of the exposures on which it rests; None if the estimator does not count them.
    """

    stamp_ns: int
    X_DU: SE2
    covariance: Array
    last_seen_ns: int
    exposures: ExposureCounts | None = None


class LosStatus(Enum):
    """The origin of the line-of-sight angles."""

    SEEN = "seen"
    """Both edges were measured recently, and advanced by the motion since."""
    PREDICTED = "predicted"
    """An edge was not seen recently; its angle follows from the estimated pose."""
    LOST = "lost"
    """There is no pose that rests on a recent detection."""


@dataclass(frozen=True, slots=True)
class LosObservation:
    """The line of sight to the docking target.

    Attributes:
        stamp_ns: Time of the angles.
        left: Angle from the camera's axis to the target's left edge, counter-clockwise positive [rad].
        right: Angle from the camera's axis to the target's right edge, counter-clockwise positive [rad].
        margin: Angle between the outer edge and the border of the field of view [rad]; negative outside.
        status: Whether the angles are measured in the image, predicted by the filter, or lost.
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
        name: Name of the obstacle, by the map from tag ids to kinds of obstacles.
        stamp_ns: Exposure time of the last detection.
        X_WB: Pose of the middle of the base on the floor.
        covariance: Covariance of (x, y, yaw) in W, shape (3, 3) [m, rad].
        radius: Radius of the circle about its footprint [m].
        shared: As in :class:`~msrr_scenes.messages.sensing.GlobalPose`.
    """

    name: str
    stamp_ns: int
    X_WB: SE2
    covariance: Array
    radius: float
    shared: Array | None = None

    @property
    def relative(self) -> Array:
        """Covariance of (x, y, yaw) against the bodies near this one, shape (3, 3) [m, rad]."""
        return self.covariance if self.shared is None else self.covariance - self.shared


@dataclass(frozen=True, slots=True, eq=False)
class ArenaEstimate:
    """The poses of all known bodies at one instant, in the world frame W.

    Attributes:
        stamp_ns: Time of ``own`` (of the last exposure when delay compensation is off).
        own: Pose of the docking unit.
        target: Pose of the unit that is docked to; None for a unit that drives without a target.
        others: Poses of the remaining units that have been seen.
        obstacles: All obstacles that have been seen.
        last_seen_ns: Exposure time of the last detection of the docking unit.
        strain: Standard deviation of the error of the distance between two bodies over that distance, by the
            errors that they share.
        exposures: What became of the overhead exposures that show the docking unit; None if not counted.
    """

    stamp_ns: int
    own: GlobalPose
    target: GlobalPose | None
    others: tuple[GlobalPose, ...]
    obstacles: tuple[ObstacleEstimate, ...]
    last_seen_ns: int
    strain: float = 0.0
    exposures: ExposureCounts | None = None

    def sigma_between(self, body: GlobalPose | ObstacleEstimate, own_reach: float, reach: float) -> float:
        """Return the standard deviation of the distance between a body and the docking unit [m].

        It holds where they are near each other: an error that they share shifts both.

        Args:
            body: The body.
            own_reach: Largest distance of the footprint of the unit from the origin of its frame [m].
            reach: That of the body [m].
        """
        strain = self.strain * (own_reach + reach)
        return math.sqrt(_variance(self.own, own_reach) + _variance(body, reach) + strain**2)


@lru_cache(maxsize=256)  # estimates never change, and that of a body that stands is the same for a while
def _variance(body: GlobalPose | ObstacleEstimate, reach: float) -> float:
    """Return the largest variance [m^2], over points of a body and directions, of the position of a point.

    It is that against bodies that are near, and not that in the world.
    """
    (xx, xy, _), (_, yy, _), (_, _, yaw) = body.relative.tolist()
    return float(0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy) + reach**2 * yaw)
