"""What sensors tell, and the types that images and time are given in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2

Pixels = NDArray[np.uint8]

#: Asks the camera for a window of the exposure at hand; returns mono8 pixels, shape (height, width).
Fetch = Callable[[Window], Pixels]

NS_PER_S = 1_000_000_000


def seconds(duration_ns: int) -> float:
    """Return a duration in nanoseconds as seconds."""
    return duration_ns / NS_PER_S


@dataclass(frozen=True, slots=True)
class Exposure:
    """One frame of one camera, not yet read out. ``camera`` is ``overhead`` or ``<unit>/onboard``."""

    camera: str
    frame: int
    stamp_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class TagDetection:
    """One decoded AprilTag.

    Attributes:
        tag_id: Identity in the tag family.
        corners: Pixels of the full frame (from pixel centres), shape (4, 2), in the order bottom left,
            bottom right, top right, top left of the tag's own image.
        decision_margin: The detector's confidence in the decoded bits [grey levels].
        hamming: Number of corrected bits.
    """

    tag_id: int
    corners: Array
    decision_margin: float = 0.0
    hamming: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """What the detector found in one exposure, and the windows it was allowed to look at."""

    exposure: Exposure
    tags: tuple[TagDetection, ...]
    windows: tuple[Window, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Localisation:
    """What a global localisation service tells in the place of the overhead camera's own detections.

    Attributes:
        detections: The tags of one exposure where the service believes them to be.
    """

    detections: Detections


@dataclass(frozen=True, slots=True, eq=False)
class PoseMeasurement:
    """A ready-made relative pose, as parametric perception gives it instead of pixels.

    Attributes:
        exposure: Camera, frame and time of exposure.
        X_DU: The unit in the dock frame D of its target.
        covariance: Of (x, y, yaw) in D, shape (3, 3) [m, rad].
        edge_bearings: Bearings (left, right) of the LOS target's edges from the camera, counter-clockwise
            positive [rad]; None where that edge is outside the field of view.
    """

    exposure: Exposure
    X_DU: SE2
    covariance: Array
    edge_bearings: tuple[float | None, float | None]


@dataclass(frozen=True, slots=True, eq=False)
class GlobalPose:
    """A unit or obstacle located by the overhead camera: ``X_WB`` with covariance (3, 3)."""

    name: str
    stamp_ns: int
    X_WB: SE2
    covariance: Array


@dataclass(frozen=True, slots=True)
class WheelOdometry:
    """Wheel encoder reading: angles turned since power-up, left and right [rad]."""

    unit: str
    stamp_ns: int
    left: float
    right: float


@dataclass(frozen=True, slots=True)
class SeatSwitches:
    """The switches at the bottom of the two holes, as told by the docked unit to the docking one."""

    unit: str
    stamp_ns: int
    left: bool
    right: bool

    @property
    def both(self) -> bool:
        """Both pins are at the bottom of their holes."""
        return self.left and self.right


class LockPosition(Enum):
    """Where the lock's cam says it is. A cam that closed on nothing says ``closed`` as well."""

    OPEN = "open"
    CLOSING = "closing"
    CLOSED = "closed"


@dataclass(frozen=True, slots=True)
class LockFeedback:
    """Cam encoder of the unit's lock."""

    unit: str
    stamp_ns: int
    position: LockPosition


SensorMessage = (
    Detections | Localisation | PoseMeasurement | GlobalPose | WheelOdometry | SeatSwitches | LockFeedback
)
