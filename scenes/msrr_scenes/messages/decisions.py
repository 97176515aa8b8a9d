"""What control decides, and what the robot holds true about its docking."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


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


class FailureReason(Enum):
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
    setback: FailureReason | None = None
    reason: str = ""
