"""Messages of the sensors, and the types of images and time."""

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

#: Function that reads a window of one exposure; returns mono8 pixels, shape (height, width).
Fetch = Callable[[Window], Pixels]

NS_PER_S = 1_000_000_000


def seconds(duration_ns: int) -> float:
    """Return a duration in nanoseconds as seconds."""
    return duration_ns / NS_PER_S


#: Name of the overhead camera.
OVERHEAD = "overhead"

_ONBOARD = "/onboard"


def onboard_camera(unit: str) -> str:
    """Return the name of the onboard camera of a unit."""
    return unit + _ONBOARD


def carrier_of(camera: str) -> str | None:
    """Return the unit that carries a camera; None for the overhead camera."""
    return camera.removesuffix(_ONBOARD) if camera.endswith(_ONBOARD) else None


@dataclass(frozen=True, slots=True)
class Exposure:
    """One frame of one camera before readout.

    Attributes:
        camera: Name of the camera: :data:`OVERHEAD` or that of :func:`onboard_camera`.
        frame: Number of the frame, counted from 0.
        stamp_ns: Time of the exposure by the clock of the camera.
    """

    camera: str
    frame: int
    stamp_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class TagDetection:
    """One decoded AprilTag.

    Attributes:
        tag_id: Id in the tag family.
        corners: Pixels (from pixel centres), shape (4, 2), in the order bottom left, bottom right, top right,
            top left of the tag's own image. A detector gives pixels of the full frame; in :class:`Detections`
            they are those of the ideal camera, without the distortion that is known.
        decision_margin: Confidence of the detector in the decoded bits [grey levels].
        hamming: Number of corrected bits.
        corner_sigma_px: Standard deviation of each coordinate of a corner, shape (4,) [px], by what the image
            shows of its edges; None if the detector does not tell.
    """

    tag_id: int
    corners: Array
    decision_margin: float = 0.0
    hamming: int = 0
    corner_sigma_px: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """The tags found in one exposure, and the windows that were read.

    Attributes:
        exposure: Camera, frame and time of exposure.
        tags: The tags.
        windows: The windows.
    """

    exposure: Exposure
    tags: tuple[TagDetection, ...]
    windows: tuple[Window, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Localisation:
    """The output of a global localisation service, in the form of the overhead camera's detections.

    Attributes:
        detections: Tags of one exposure at the pixels that follow from the service's erroneous poses.
    """

    detections: Detections


@dataclass(frozen=True, slots=True, eq=False)
class PoseMeasurement:
    """A measured relative pose, which parametric perception gives instead of pixels.

    Attributes:
        exposure: Camera, frame and time of exposure.
        X_DU: Pose of the unit in the dock frame D of its target.
        covariance: Covariance of (x, y, yaw) in D, shape (3, 3) [m, rad].
        edge_bearings: Bearings (left, right) of the LOS target's edges from the camera, counter-clockwise
            positive [rad]; None where that edge is outside the field of view.
    """

    exposure: Exposure
    X_DU: SE2
    covariance: Array
    edge_bearings: tuple[float | None, float | None]


@dataclass(frozen=True, slots=True, eq=False)
class GlobalPose:
    """The pose of a unit or obstacle in the world.

    Attributes:
        name: Name of the body.
        stamp_ns: Time of the pose.
        X_WB: The pose.
        covariance: Covariance of (x, y, yaw) in W, shape (3, 3) [m, rad].
        shared: Part of the covariance, shape (3, 3), of the error that the bodies near this one have as well,
            because they are seen by the same camera; None: no error is shared.
    """

    name: str
    stamp_ns: int
    X_WB: SE2
    covariance: Array
    shared: Array | None = None

    @property
    def relative(self) -> Array:
        """Covariance of (x, y, yaw) against the bodies near this one, shape (3, 3) [m, rad]."""
        return self.covariance if self.shared is None else self.covariance - self.shared


@dataclass(frozen=True, slots=True)
class WheelOdometry:
    """A wheel encoder reading.

    Attributes:
        unit: Unit that carries the encoders.
        stamp_ns: Time of the reading.
        left: Angle that the left wheel has turned since power-up, forwards positive [rad].
        right: The same for the right wheel [rad].
    """

    unit: str
    stamp_ns: int
    left: float
    right: float


@dataclass(frozen=True, slots=True)
class SeatSwitches:
    """The switches at the bottom of the two holes, as the docked unit reports them to the docking one.

    Attributes:
        unit: Unit that docks, to which they are reported.
        stamp_ns: Time of the reading.
        left: Whether the left switch is closed, so that a pin is at the bottom of its hole.
        right: The same for the right switch.
    """

    unit: str
    stamp_ns: int
    left: bool
    right: bool

    @property
    def both(self) -> bool:
        """Whether both pins are at the bottom of their holes."""
        return self.left and self.right

    @property
    def either(self) -> bool:
        """Whether the left one, the right one or both are closed."""
        return self.left or self.right


class LockPosition(Enum):
    """The reported position of the lock's actuator, which reports ``closed`` also if it closed on nothing."""

    OPEN = "open"
    """The lock is open."""
    CLOSING = "closing"
    """The lock was told to close and is on its way."""
    CLOSED = "closed"
    """The actuator is at its end, whether or not it holds a pin."""


@dataclass(frozen=True, slots=True)
class LockFeedback:
    """A reading of the lock's position encoder.

    Attributes:
        unit: Unit that carries the lock.
        stamp_ns: Time of the reading.
        position: Position of the actuator.
    """

    unit: str
    stamp_ns: int
    position: LockPosition


SensorMessage = (
    Detections | Localisation | PoseMeasurement | GlobalPose | WheelOdometry | SeatSwitches | LockFeedback
)
