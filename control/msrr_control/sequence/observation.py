"""What the phase machine observes, and the interface of the long-distance phase that it runs first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from msrr_scenes.messages import (
    ArenaEstimate,
    AssemblyPath,
    AssemblyProgress,
    CollisionMonitorState,
    FailureReason,
    LockFeedback,
    LosObservation,
    PoseEstimate,
    SeatSwitches,
    Twist,
    seconds,
)


class Observation(NamedTuple):
    """All that is known at one control instant, from estimates and the unit's own sensors.

    Attributes:
        now_ns: Time of the instant.
        pose: Pose estimate of the unit in the dock frame, None before the first measurement.
        los: Line of sight to the target, None before the first observation.
        switches: Last report of the seat switches, None before the first.
        lock: Last report of the lock, None before the first.
        twist: (v, w) as measured by the wheel encoders. Wheels slip against a port: it proves no motion.
        arena: Estimates of global localisation, None before it knows the unit and its target.
        overhead_exposed_ns: Exposure time of the newest overhead picture that has arrived, None before one.
        monitor: Decision of the collision monitor on the last command, None before the first.
        passed: What it let pass of that command; None without a monitor, or before the first.
        tags_read_ns: Exposure time of the newest onboard frame in which a tag of the target was read, whether
            or not a pose agrees with it; None before one.
    """

    now_ns: int
    pose: PoseEstimate | None = None
    los: LosObservation | None = None
    switches: SeatSwitches | None = None
    lock: LockFeedback | None = None
    twist: Twist = Twist()
    arena: ArenaEstimate | None = None
    overhead_exposed_ns: int | None = None
    monitor: CollisionMonitorState | None = None
    passed: Twist | None = None
    tags_read_ns: int | None = None

    @property
    def both_closed(self) -> bool:
        """Whether both seat switches are closed, by their last report; not before the first one."""
        return self.switches is not None and self.switches.both

    @property
    def held(self) -> str:
        """End of a reason while the collision monitor limits the commands; empty while it does not."""
        limits = self.monitor is not None and self.monitor.limits
        return f", held by the collision monitor: {self.monitor}" if limits else ""

    def not_localised(self, waited_s: float) -> GiveUp:
        """Return the end of a phase in which global localisation did not see the unit for so long [s]."""
        seen = "the unit, or its target, was never seen from above"
        if self.arena is not None:
            seen = f"last seen from above {seconds(self.now_ns - self.arena.last_seen_ns):.1f} s ago"
        return GiveUp(FailureReason.NOT_LOCALISED, f"not localised for {waited_s:.1f} s: {seen}")


@dataclass(frozen=True, slots=True)
class GiveUp:
    """The end of the long-distance phase without success, with the unit at rest.

    Attributes:
        failure: Why the unit gives up.
        reason: Reason with figures, for the log and the reader.
    """

    failure: FailureReason
    reason: str


class Assembler(Protocol):
    """The long-distance phase, which brings the unit in front of the port.

    A scene names an assembler by registered name or import path; it is built as ``Class(setup, **params)``
    with an :class:`~msrr_control.staging.setup.AssemblySetup` and the scene's ``control.assembly.params``.
    """

    @property
    def progress(self) -> AssemblyProgress | None:
        """What the assembler did at the last instant, for the log; None if there is nothing to report."""
        ...

    @property
    def path(self) -> AssemblyPath | None:
        """Path that is followed or was followed last, for the log; None if there is none."""
        ...

    def reset(self, reason: str) -> None:
        """Begin again from wherever the unit stands, after the hand-over failed there."""
        ...

    def step(self, observation: Observation) -> Twist | GiveUp | None:
        """Return the command, or None once the unit stands where the hand-over can begin."""
        ...
