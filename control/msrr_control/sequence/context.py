"""What the states of a docking step share: transitions, the memory of one stay, and their context."""

from __future__ import annotations

import math
from dataclasses import dataclass

from msrr_control.docking.controller import ControlInputs, Controller
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.observation import Assembler, Observation
from msrr_control.sequence.port_view import PortView
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.messages import Belief, FailureReason, Phase, PoseEstimate, seconds
from msrr_scenes.specs.plan import DockingSpec


@dataclass(frozen=True, slots=True)
class Transition:
    """A change of phase and its reason.

    Attributes:
        to: Next phase.
        reason: Reason with figures, for the log and the reader.
        failure: Why the attempt failed, None if it did not.
        reassemble: Whether the next attempt begins with the long-distance phase, as the hand-over itself
            failed.
    """

    to: Phase
    reason: str
    failure: FailureReason | None = None
    reassemble: bool = False


class HoldTimer:
    """Measures how long a condition has held without a break."""

    def __init__(self) -> None:
        """Begin with a condition that does not hold."""
        self._since_ns: int | None = None

    def update(self, holds: bool, now_ns: int) -> float:
        """Return the time [s] for which the condition has held; -1 while it does not."""
        if not holds:
            self._since_ns = None
            return -1.0
        if self._since_ns is None:
            self._since_ns = now_ns
        return seconds(now_ns - self._since_ns)


class StateMemory:
    """The memory of one stay in a phase.

    Attributes:
        since_ns: Time at which the phase was entered.
        turned: Heading turned since the target was last seen, by odometry [rad].
        unseen: Timer of the target being unseen.
        switches: Timer of the seat switches saying what the phase waits for.
        opened: Timer of the lock being open.
        looked_behind: Timer of the unit knowing what is behind it, or no longer waiting to know.
        arrived: Timer of the unit standing at the end of its retreat.
    """

    def __init__(self, since_ns: int) -> None:
        """Begin a stay."""
        self.since_ns = since_ns
        self.turned = 0.0
        self.unseen, self.switches, self.arrived = HoldTimer(), HoldTimer(), HoldTimer()
        self.opened, self.looked_behind = HoldTimer(), HoldTimer()
        self._best, self._best_ns = math.inf, since_ns
        self._frames, self._last_frame_ns = 0, since_ns

    def lasted(self, now_ns: int) -> float:
        """Return the time [s] since the phase was entered."""
        return seconds(now_ns - self.since_ns)

    def without_progress(self, remaining: float, step: float, now_ns: int) -> float:
        """Return the time [s] since ``remaining`` [m] last fell by ``step`` [m] or more below its minimum."""
        if remaining < self._best - step:
            self._best, self._best_ns = remaining, now_ns
        return seconds(now_ns - self._best_ns)

    def frames_in_a_row(self, exposed_ns: int, agrees: bool) -> int:
        """Count the frames exposed since the phase began that agree, from the last one that did not."""
        if exposed_ns > self._last_frame_ns:
            self._last_frame_ns = exposed_ns
            self._frames = self._frames + 1 if agrees else 0
        return self._frames


class DockingContext:
    """What the states go by, and what outlasts a stay in one of them.

    Attributes:
        spec: Attempts, times and speeds of the task.
        setup: Facts of the docking step.
        controller: Drives from the hand-over to the port.
        assembler: Long-distance phase; None if the unit starts in front of the port.
        tuning: Figures of the mechanism and the sensors.
        observation: What is known at this instant.
        view: Where the port is at this instant, None while nothing is known of it.
        dt: Time since the previous instant [s].
        memory: Memory of the present stay.
        belief: What the unit says about this docking step so far.
        attempt: Attempt under way, counted from 1.
        ever_seen: Whether the target was ever seen.
        undocking: Whether the unit was told to undock.
        reassemble: Whether the next attempt begins with the long-distance phase.
    """

    def __init__(
        self,
        spec: DockingSpec,
        setup: DockSetup,
        controller: Controller,
        assembler: Assembler | None,
        tuning: PhaseTuning,
    ) -> None:
        """Begin before the first attempt."""
        self.spec, self.setup, self.controller = spec, setup, controller
        self.assembler, self.tuning = assembler, tuning
        self.observation = Observation(0)
        self.view: PortView | None = None
        self.dt = 1.0 / setup.rate_hz
        self.memory = StateMemory(0)
        self.belief, self.attempt = Belief(), 1
        self.ever_seen = self.undocking = self.reassemble = False
        self._gap: float | None = None  # last known, updated by odometry while there is no estimate
        self._previous_ns: int | None = None

    @property
    def now_ns(self) -> int:
        """Time of this instant."""
        return self.observation.now_ns

    @property
    def gap(self) -> float:
        """Last known distance between the faces [m]; that of a finished retreat while it is unknown."""
        return self._gap if self._gap is not None else self.spec.retreat_m

    def forget_gap(self) -> None:
        """Take the gap for unknown, as the unit goes far away."""
        self._gap = None

    def observe(self, observation: Observation) -> None:
        """Take in what is known at this instant; called once an instant."""
        now_ns, pose = observation.now_ns, observation.pose
        if self._previous_ns is not None and now_ns > self._previous_ns:
            self.dt = seconds(now_ns - self._previous_ns)
        self._previous_ns, self.observation = now_ns, observation
        if pose is None:
            self.view = None
            if self._gap is not None:
                self._gap -= self.dt * observation.twist.v
            return
        self.view = PortView.of(pose, observation.los, self.setup, now_ns)
        self._gap, self.ever_seen = self.view.gap, True

    def control_inputs(self, pose: PoseEstimate) -> ControlInputs:
        """Return what the controller is given at this instant."""
        return ControlInputs(self.now_ns, self.dt, pose, self.observation.los, self.observation.twist)
