"""Messages that only the log holds: truth, events, pixels, coordinate frames."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from msrr_bullet.collision.clearance import Clearance
from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Exposure, Pixels
from msrr_scenes.outcome import Outcome
from msrr_scenes.specs.plan import DockStep
from msrr_scenes.specs.scene import Scene


@dataclass(frozen=True, slots=True, eq=False)
class CameraWindow:
    """Pixels that the camera delivered for one window of one exposure: mono8, shape (height, width)."""

    exposure: Exposure
    window: Window
    pixels: Pixels


@dataclass(frozen=True, slots=True)
class StepStart:
    """Start of a step, or of a route into the open on which a base station sends a unit.

    A unit on its own begins every step with a new :class:`~msrr_bullet.robot.autonomy.Autonomy`.

    Attributes:
        stamp_ns: Time.
        index: Index of the step: in the scene's plan, or among those that a base station has begun; -1 for a
            route into the open.
        unit: Name of the unit that docks or undocks, or drives into the open.
        port: Its active port; empty on a route into the open, and in logs of older versions.
        to: Port that it docks to or leaves, ``<unit>.<port>``; empty likewise.
    """

    stamp_ns: int
    index: int
    unit: str
    port: str = ""
    to: str = ""

    @property
    def in_the_open(self) -> bool:
        """Whether a base station sends the unit on a route into the open."""
        return self.index < 0

    def step(self, scene: Scene) -> DockStep | None:
        """Return the step: that of the scene's plan, or one of a base station; None without one."""
        if self.in_the_open:
            return None
        if scene.coordinated:
            return DockStep(unit=self.unit, port=self.port, to=self.to)
        return scene.docks[self.index]


@dataclass(frozen=True, slots=True)
class RadioReceipt:
    """Arrival of a message over the radio.

    Attributes:
        stamp_ns: Time of arrival.
        unit: Unit to which an authority is sent, or that reports.
        number: Number of the authority, or time of the report.
    """

    stamp_ns: int
    unit: str
    number: int


@dataclass(frozen=True, slots=True)
class TruePose:
    """True pose ``X_WB`` of the unit ``name``."""

    name: str
    stamp_ns: int
    X_WB: SE2


@dataclass(frozen=True, slots=True)
class StartPoses:
    """Poses in which the trial begins.

    Attributes:
        redraws: Number of random starts that were rejected and drawn again.
        poses: ``X_WB`` by the name of the body; of a recording the target alone, whose dock frame is W.
    """

    redraws: int
    poses: dict[str, SE2]


@dataclass(frozen=True, slots=True)
class BuiltErrors:
    """What is not as the scene says; a log without this record is of a trial in which all was as designed.

    Attributes:
        errors: True minus told value of every quantity that was given or drawn, by part and quantity, in the
            unit in which the name ends (``unit/a/onboard/yaw_deg``).
    """

    errors: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class ClearanceRecord:
    """Smallest distance between two bodies that may not touch, from their true poses.

    The judge leaves out a pair that is docking, and units that are locked together.

    Attributes:
        stamp_ns: Time.
        pair: Names of the bodies.
        distance: Smallest distance [m]; negative when they overlap.
        nearest: Nearest points in W, one row for each body, shape (2, 2) [m]; None if unknown.
    """

    stamp_ns: int
    pair: tuple[str, str]
    distance: float
    nearest: Array | None = None

    @classmethod
    def of(cls, stamp_ns: int, clearance: Clearance) -> ClearanceRecord:
        """Return the record of a measured clearance."""
        nearest = np.array([clearance.point_a, clearance.point_b])
        return cls(stamp_ns, (clearance.body_a, clearance.body_b), clearance.distance, nearest)

    @property
    def clearance(self) -> Clearance | None:
        """Measured clearance; None when the nearest points are unknown."""
        if self.nearest is None:
            return None
        a, b = ((float(point[0]), float(point[1])) for point in self.nearest)
        return Clearance(self.distance, *self.pair, a, b)


class Level(Enum):
    """Severity of an event, numbered as in ``foxglove.Log``."""

    DEBUG = 1
    INFO = 2
    WARNING = 3
    ERROR = 4


#: Source of the event that holds the verdict.
JUDGE = "judge"


@dataclass(frozen=True, slots=True)
class Event:
    """Change of phase, contact, fault or verdict in words, with the name of the component that reports it."""

    stamp_ns: int
    source: str
    text: str
    level: Level = Level.INFO

    @property
    def is_verdict(self) -> bool:
        """Whether it is the verdict on the trial; that of an interrupted trial is missing."""
        return self.source == JUDGE and self.text in {outcome.value for outcome in Outcome}


@dataclass(frozen=True, slots=True, eq=False)
class FrameLink:
    """Coordinate frame that is fixed to another one: ``X_parent_child``."""

    parent: str
    child: str
    X: SE3


@dataclass(frozen=True, slots=True, eq=False)
class FrameLinks:
    """Coordinate frames that do not move in their parents: cameras, ports, the target of a recording."""

    stamp_ns: int
    links: tuple[FrameLink, ...]
