"""What a log holds beyond the messages between the rooms: truth, events, pixels."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from msrr_scenes.arrays import Array
from msrr_scenes.geometry.pinhole import Window
from msrr_scenes.geometry.se2 import SE2
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.messages import Exposure, Pixels

if TYPE_CHECKING:
    from msrr_bullet.collision import clearance


@dataclass(frozen=True, slots=True, eq=False)
class CameraWindow:
    """The pixels that the camera delivered for one window of one exposure: mono8, shape (height, width)."""

    exposure: Exposure
    window: Window
    pixels: Pixels


@dataclass(frozen=True, slots=True)
class StepStart:
    """The beginning of a step of the plan.

    From here on ``unit`` is driven by a new :class:`~msrr_bullet.robot.autonomy.Autonomy`.

    Attributes:
        stamp_ns: Time.
        index: Index of the step in the scene's plan.
        unit: The unit that docks.
    """

    stamp_ns: int
    index: int
    unit: str


@dataclass(frozen=True, slots=True)
class TruePose:
    """Where a body is in truth: ``X_WB`` of the unit (or obstacle) ``name``."""

    name: str
    stamp_ns: int
    X_WB: SE2


@dataclass(frozen=True, slots=True)
class StartPoses:
    """Where the bodies were set down.

    Attributes:
        redraws: Draws thrown away because the start could not be used.
        poses: ``X_WB`` by the body's name.
    """

    redraws: int
    poses: dict[str, SE2]


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """Distance between two bodies, from their true poses.

    Attributes:
        stamp_ns: Time.
        pair: Names of the bodies.
        distance: Smallest distance [m]; negative when they overlap.
        nearest: The nearest points in W, one row for each body, shape (2, 2) [m]; None if not
            known.
        exempt: The pair is docking and may touch.
    """

    stamp_ns: int
    pair: tuple[str, str]
    distance: float
    nearest: Array | None = None
    exempt: bool = False

    @classmethod
    def of(cls, stamp_ns: int, measured: clearance.Clearance, exempt: bool = False) -> Clearance:
        """Record what the clearance model measured."""
        points = np.array([measured.point_a, measured.point_b])
        return cls(stamp_ns, (measured.body_a, measured.body_b), measured.distance, points, exempt)


class Level(Enum):
    """How much an event matters; the numbers are those of ``foxglove.Log``."""

    DEBUG = 1
    INFO = 2
    WARNING = 3
    ERROR = 4


#: Who speaks in the event that tells the verdict.
JUDGE = "judge"


@dataclass(frozen=True, slots=True)
class Event:
    """Something worth a line: a phase, a contact, a fault, the verdict. ``source`` says who speaks."""

    stamp_ns: int
    source: str
    text: str
    level: Level = Level.INFO


@dataclass(frozen=True, slots=True, eq=False)
class FrameLink:
    """A frame fixed to another one: ``X_parent_child``."""

    parent: str
    child: str
    X: SE3


@dataclass(frozen=True, slots=True, eq=False)
class FrameLinks:
    """Frames that do not move against their parents: cameras, ports, the target of a step."""

    stamp_ns: int
    links: tuple[FrameLink, ...]
