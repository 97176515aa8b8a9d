"""What the phase machine is told, and who drives before the hand-over."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from msrr_scenes.messages import (
    ArenaEstimate,
    FailureReason,
    LockFeedback,
    LosObservation,
    PoseEstimate,
    SeatSwitches,
    Twist,
)


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """All that is known at one control instant; estimates and own sensors only.

    Attributes:
        now_ns: Time.
        pose: Estimate of the unit in the dock frame, None before the first measurement.
        los: Line of sight to the target, None before the first.
        switches: Seat switches' last report, None before the first.
        lock: Lock's last report, None before the first.
        twist: Measured by the wheel encoders. Wheels slip against a port: it proves no motion.
        situation: What global localisation knows, None before it knows the unit and its target.
        looked_around_ns: Exposure time of the newest overhead picture that has arrived, None before one.
    """

    now_ns: int
    pose: PoseEstimate | None = None
    los: LosObservation | None = None
    switches: SeatSwitches | None = None
    lock: LockFeedback | None = None
    twist: Twist = field(default_factory=Twist)
    situation: ArenaEstimate | None = None
    looked_around_ns: int | None = None


@dataclass(frozen=True, slots=True)
class GiveUp:
    """The long-distance phase ends here, with the unit at rest."""

    setback: FailureReason
    reason: str


class Assembler(Protocol):
    """The long-distance phase: brings the unit in front of the port."""

    def reset(self, reason: str) -> None:
        """Begin again from wherever the unit stands: the hand-over failed there."""
        ...

    def step(self, senses: Observation) -> Twist | GiveUp | None:
        """Return the command, or None once the unit stands where the hand-over can begin."""
        ...
