"""Messages of control: commands, the path of the long-distance phase, and the robot's belief."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


@dataclass(frozen=True, slots=True)
class AssemblyProgress:
    """The state of the long-distance phase at one control instant; points in the world frame W.

    Attributes:
        stamp_ns: Time of the decision.
        stage: ``localise``, ``brake``, ``plan``, ``turn``, ``clear``, ``reverse``, ``drive`` or
            ``settle``.
        path: Number of the current path, counted from 1; 0 before the first.
        tip: Estimated position of the controlled point [m].
        desired: Point p_d of the path at which the controlled point should be now [m].
        reference: Point phi1 to which the upper layer sends the controlled point [m].
        s: Arc length of ``desired`` on the path [m].
        arc_end: Arc length at which the path's last arc ends [m].
        length: Length of the path [m].
        avoiding: Obstacle that is being avoided, None if there is none.
        reason: Why the stage was entered, in words.
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
        stamp_ns: Time of the decision.
        number: Number of the path, counted from 1.
        shape: ``arc``, ``around`` or ``staged``; ``granted`` where a base station has planned it.
        points: Points of the controlled point's path in W, every few centimetres [m].
        reason: Why the path was chosen, in words.
    """

    stamp_ns: int
    number: int
    shape: str
    points: tuple[tuple[float, float], ...]
    reason: str


class MonitorState(Enum):
    """The effect of the collision monitor: a command passes, passes slower or in part, or not at all."""

    FREE = "free"
    """The command passes as it is."""
    SLOW = "slow"
    """The command passes slower, or in part."""
    STOP = "stop"
    """Nothing of the command passes."""


@dataclass(frozen=True, slots=True)
class CollisionMonitorState:
    """The decision of the collision monitor on the command of one control instant, from estimates alone.

    Attributes:
        stamp_ns: Time of the command.
        state: Effect on the command.
        body: Nearest known body; None when the monitor is disabled or every known body is too far away to
            matter.
        clearance: Present distance from that body [m]; None without one.
        ahead: Smallest clearance along the trajectory of the whole command [m], less the uncertainty of the
            estimates; a lower bound where ``body`` is None.
    """

    stamp_ns: int
    state: MonitorState
    body: str | None
    clearance: float | None
    ahead: float

    @property
    def limits(self) -> bool:
        """Whether the command did not pass as it was."""
        return self.state is not MonitorState.FREE

    def __str__(self) -> str:
        """Return in words how near a body is, such as ``28 mm to hub, 3 mm of it certain ahead``."""
        if self.body is None or self.clearance is None:
            return "no body near"
        certain = min(max(self.ahead, 0.0), self.clearance)
        return f"{1e3 * self.clearance:z.0f} mm to {self.body}, {1e3 * certain:.0f} mm of it certain ahead"


@dataclass(frozen=True, slots=True)
class Twist:
    """The body velocity of a differential drive.

    Attributes:
        v: Forward velocity [m/s].
        w: Turn rate, counter-clockwise positive [rad/s].
    """

    v: float = 0.0
    w: float = 0.0


class Phase(Enum):
    """The phases of one docking step."""

    ASSEMBLE = "assemble"
    """The long distance: the unit drives to a place in front of the port."""
    HAND_OVER = "hand_over"
    """The unit looks for the port with its own camera. It comes nearer at a creep while it sees the port and
    is not certain where, and turns to both sides while it sees nothing."""
    CALIBRATE = "calibrate"
    """The unit drives in front of the port to find out the errors of its camera and wheels."""
    DOCK = "dock"
    """The docking law drives the unit into the port, where it presses until it is seated."""
    LOCK = "lock"
    """The lock closes."""
    VERIFY = "verify"
    """The unit compares what it sees with what a seated unit sees."""
    TUG_TEST = "tug_test"
    """The locked unit drives backwards: one that is held is not seen to move, whatever sight is off by."""
    RETREAT = "retreat"
    """The lock is open and the unit backs out of the port for another attempt, or for good."""
    DONE = "done"
    """The unit believes that it is docked, and keeps checking it."""
    FAILED = "failed"
    """The unit has given up."""

    @property
    def text(self) -> str:
        """The phase in words, as messages name it."""
        return self.value.replace("_", " ")


@dataclass(frozen=True, slots=True)
class Action:
    """The decision of the robot at one control instant.

    Attributes:
        stamp_ns: Time of the decision.
        phase: Current phase.
        attempt: Number of the attempt, counted from 1.
        twist: Velocity command.
        lock: Command to the lock: True closes it, False opens it.
        reason: Why the phase was entered, in words; in the long-distance phase why the unit does
            what it does.
    """

    stamp_ns: int
    phase: Phase
    attempt: int
    twist: Twist = field(default_factory=Twist)
    lock: bool = False
    reason: str = ""

    def with_twist(self, twist: Twist) -> Action:
        """Return the same decision with another velocity command."""
        return Action(self.stamp_ns, self.phase, self.attempt, twist, self.lock, self.reason)


class Conviction(Enum):
    """The robot's verdict on a docking step."""

    UNDECIDED = "undecided"
    """The step is under way."""
    DOCKED = "docked"
    """The unit says that it is docked."""
    UNDOCKED = "undocked"
    """The unit says that it has left the port."""
    GAVE_UP = "gave_up"
    """The unit says that it has failed."""


class FailureReason(Enum):
    """The reason why an attempt ended, as far as the robot can tell."""

    NEVER_DETECTED = "never_detected"
    """No measurement of the target in the whole step."""
    TARGET_LOST = "target_lost"
    """Seen before, but not for ``docking.lost_time_s`` of an approach or ``search_time_s`` of a hand-over."""
    UNREADY = "unready"
    """Seen, but never well enough or never inside the cone."""
    OFF_AXIS = "off_axis"
    """At the port, too far off its axis for the pins to enter, or slid out of it."""
    STALLED = "stalled"
    """No progress towards the port, or no seat behind it; ``docking.stall_time_s`` is the time allowed."""
    NOT_LATCHED = "not_latched"
    """The lock did not report closed, or the switches opened meanwhile."""
    NOT_VERIFIED = "not_verified"
    """Latched, but the target is not seen, or the unit moved in a tug test."""
    NOT_LOCALISED = "not_localised"
    """Global localisation does not know where the unit stands."""
    BLOCKED = "blocked"
    """No free path to the place in front of the port."""
    SEIZED = "seized"
    """The wheels do not turn although the drive is commanded to turn them."""
    NOT_RELEASED = "not_released"
    """Backed out, but nothing shows that the unit has parted from the port."""
    LOCK_OPENED = "lock_opened"
    """Was docked, then the lock no longer reported closed."""
    UNSEATED = "unseated"
    """Was docked, then the seat switches opened or sight showed the unit off its seat."""


@dataclass(frozen=True, slots=True)
class Belief:
    """The robot's own account of the docking step, which the judge compares with the truth.

    Attributes:
        conviction: Verdict so far.
        setback: Reason why the last attempt failed, or why a unit no longer believes that it is docked; None
            while there is none.
        reason: That reason in words, with figures.
    """

    conviction: Conviction = Conviction.UNDECIDED
    setback: FailureReason | None = None
    reason: str = ""
