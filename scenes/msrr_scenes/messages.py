"""What travels between the rooms: sensor messages, estimates and commands.

All are frozen, small, and stamped with integer nanoseconds of simulated time. A measurement carries
the time of its *exposure*, never of its arrival. None of them carries truth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from msrr_scenes.pinhole import Window
from msrr_scenes.se2 import SE2

Array = NDArray[np.float64]
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
class GlobalPose:
    """A unit or obstacle located by the overhead camera: ``X_WB`` with covariance (3, 3)."""

    name: str
    stamp_ns: int
    X_WB: SE2
    covariance: Array


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
class Situation:
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


@dataclass(frozen=True, slots=True)
class AssemblyProgress:
    """The long-distance phase at one control instant, as the unit has it; points in the world frame W.

    Attributes:
        stamp_ns: Time of the decision.
        stage: ``localise``, ``brake``, ``plan``, ``turn``, ``drive`` or ``settle``.
        path: Number of the path under way, counted from 1; 0 before the first.
        tip: Controlled point, estimated [m].
        desired: Point p_d of the path where the controlled point should be now [m].
        reference: Point phi1 that the upper layer lets it go to [m].
        s: Arc length of ``desired`` on the path [m].
        arc_end: Arc length at which the path's last arc ends [m].
        length: Length of the path [m].
        avoiding: Obstacle whose wall stands now, None if none does.
        reason: Why the stage was entered.
    """

    stamp_ns: int
    stage: str
    path: int
    tip: tuple[float, float]
    desired: tuple[float, float]
    reference: tuple[float, float]
    s: float
    arc_end: float
    length: float
    avoiding: str | None
    reason: str


@dataclass(frozen=True, slots=True)
class AssemblyPath:
    """A path that the long-distance phase has chosen.

    Attributes:
        stamp_ns: When.
        number: Counted from 1.
        shape: ``arc``, ``around`` or ``staged``.
        points: Points of the controlled point's path in W, every few centimetres [m].
        reason: Why it was chosen now.
    """

    stamp_ns: int
    number: int
    shape: str
    points: tuple[tuple[float, float], ...]
    reason: str


@dataclass(frozen=True, slots=True)
class Twist:
    """Body velocity of a differential drive: forward ``v`` [m/s], counter-clockwise ``w`` [rad/s]."""

    v: float = 0.0
    w: float = 0.0


class Phase(Enum):
    """Phases of one docking step."""

    ASSEMBLE = "assemble"
    HAND_OVER = "hand_over"
    DOCK = "dock"
    LOCK = "lock"
    VERIFY = "verify"
    RETREAT = "retreat"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Action:
    """What the robot decides at one control instant.

    Attributes:
        stamp_ns: Time of the decision.
        phase: Phase it is in.
        attempt: Counted from 1.
        twist: Velocity command.
        lock: True closes the lock, False opens it.
        reason: Why the phase was entered, for the log and the reader.
    """

    stamp_ns: int
    phase: Phase
    attempt: int
    twist: Twist = field(default_factory=Twist)
    lock: bool = False
    reason: str = ""


class Conviction(Enum):
    """What the robot holds true about a docking step."""

    UNDECIDED = "undecided"
    DOCKED = "docked"
    UNDOCKED = "undocked"
    GAVE_UP = "gave_up"


class Setback(Enum):
    """Why an attempt ended, as far as the robot can tell."""

    NEVER_DETECTED = "never_detected"  # no measurement of the target in the whole step
    TARGET_LOST = "target_lost"  # seen before, not seen any more
    UNREADY = "unready"  # seen, but never well enough or never inside the cone
    OFF_AXIS = "off_axis"  # at the port, too far off its axis for the pins to enter
    STALLED = "stalled"  # no progress towards the port, or no seat behind it
    NOT_LATCHED = "not_latched"  # the cam did not report closed, or the switches opened meanwhile
    NOT_VERIFIED = "not_verified"  # latched, but what is seen is not a seated unit
    NOT_LOCALISED = "not_localised"  # global localisation does not know, or no longer, where the unit stands
    BLOCKED = "blocked"  # no way to the place in front of the port


@dataclass(frozen=True, slots=True)
class Belief:
    """What the robot says about the docking step; the judge knows better.

    Attributes:
        conviction: Its verdict so far.
        setback: Why the last attempt failed; None while none has.
        reason: The same in words, with figures.
    """

    conviction: Conviction = Conviction.UNDECIDED
    setback: Setback | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Localisation:
    """What a global localisation service tells in the place of the overhead camera's own detections.

    Attributes:
        detections: The tags of one exposure where the service believes them to be.
    """

    detections: Detections


SensorMessage = (
    Detections | Localisation | PoseMeasurement | GlobalPose | WheelOdometry | SeatSwitches | LockFeedback
)
