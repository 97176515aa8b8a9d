"""What the states of a docking step share: transitions, and their context."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from msrr_control.docking.controller import ControlInputs, Controller
from msrr_control.docking.law import DockSetup
from msrr_control.docking.retreat import retreat_twist
from msrr_control.sequence.aim import Aim
from msrr_control.sequence.observation import Assembler, Observation
from msrr_control.sequence.port_view import PortView
from msrr_control.sequence.state_memory import StateMemory
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.messages import Belief, FailureReason, Phase, PoseEstimate, Twist, seconds
from msrr_scenes.specs.control import DockingSpec

STILL = Twist()

#: Standard deviations by which the next attempt aims elsewhere, after pins have jammed or slid out.
_ASIDE = 2.0


@dataclass(frozen=True, slots=True)
class Transition:
    """A change of phase and its reason.

    Attributes:
        to: Next phase.
        reason: Reason with figures, for the log and the reader.
        failure: Why the attempt failed, None if it did not.
        reassemble: Whether the next attempt begins with the long-distance phase, as the hand-over itself
            failed or the collision monitor held the approach.
    """

    to: Phase
    reason: str
    failure: FailureReason | None = None
    reassemble: bool = False

    @classmethod
    def back_out(cls, reason: str, failure: FailureReason, reassemble: bool = False) -> Transition:
        """End an attempt: back out, then try again, with the long-distance phase first to reassemble."""
        return cls(Phase.RETREAT, reason, failure, reassemble)


@dataclass(slots=True)
class DockingContext:
    """What the states go by, and what outlasts a stay in one of them.

    Attributes:
        spec, setup, controller, assembler, tuning: As the phase machine was given them.
        dt: Time between the last two instants [s].
        observation: What is known at this instant.
        view: Where the port is at this instant, None while nothing is known of it.
        memory: Memory of the present stay.
        belief: What the unit says about this docking step so far.
        attempt: Attempt under way, counted from 1.
        ever_seen: Whether the target was ever seen.
        turned: Heading turned, by odometry, since the hand-over last saw the target, or since the
            long-distance phase had the unit face it [rad].
        undocking: Whether the unit was commanded to undock.
        reassemble: Whether the next attempt begins with the long-distance phase.
        searches: Searches of this attempt that have failed: the unit has backed out, and searches anew.
        approached: Whether this attempt has come beyond its searches.
        calibrate: Whether the unit has yet to calibrate before it docks.
        aim: Where the unit docks beside the axis.
        was_in_holes: Whether a seat switch has closed at the port in this attempt: a pin was at the bottom.
        came_turned: By how much the unit may have come in turned to the left [rad]: by two standard
            deviations, to the side that the first pin at the bottom tells; 0 if both were there at once.
        presses: Whether the unit presses on in its seat, as a seat switch has opened with the wheels at rest.
        speed_share: Share of ``spec.press_mps`` at which the unit comes to the port and presses; see
            :meth:`slow_down`.
        distrusts: Whether the seat switches were closed away from the port, or before they should, or while
            a tug test showed that the unit is not held: they tell nothing of a seat.
        closed_gaps: Gaps that were seen at the left and at the right pin when its seat switch closed [m];
            None while it is open.
        seat: How the unit sees its seat, in which a tug test has shown it to be held; None before one.
        last_gap: Last known distance between the faces [m], updated by odometry; None while unknown.
    """

    spec: DockingSpec
    setup: DockSetup
    controller: Controller
    assembler: Assembler | None
    tuning: PhaseTuning
    dt: float
    observation: Observation = field(default_factory=lambda: Observation(0))
    view: PortView | None = None
    memory: StateMemory = field(default_factory=lambda: StateMemory(0))
    belief: Belief = field(default_factory=Belief)
    attempt: int = 1
    ever_seen: bool = False
    turned: float = 0.0
    undocking: bool = False
    reassemble: bool = False
    searches: int = 0
    approached: bool = False
    calibrate: bool = False
    aim: Aim = field(default_factory=Aim)
    was_in_holes: bool = False
    came_turned: float = 0.0
    presses: bool = False
    speed_share: float = 1.0
    distrusts: bool = False
    closed_gaps: tuple[float | None, float | None] = (None, None)
    seat: PortView | None = None
    last_gap: float | None = None
    _previous_ns: int | None = None

    @property
    def now_ns(self) -> int:
        """Time of this instant."""
        return self.observation.now_ns

    @property
    def gap(self) -> float:
        """Last known distance between the faces [m]; that of a finished retreat while it is unknown."""
        return self.last_gap if self.last_gap is not None else self.spec.retreat_m

    @property
    def press_mps(self) -> float:
        """Speed at which the unit presses [m/s]."""
        return self.speed_share * self.spec.press_mps

    def greatest_speed(self, gap: float) -> float:
        """Return the greatest speed [m/s] at a distance between the faces on the way to the port [m]."""
        if self.speed_share == 1.0:
            return math.inf
        return self.press_mps + max(gap - self.setup.pin_reach, 0.0) / self.tuning.slowing_s

    def slow_down(self) -> None:
        """Drive more slowly at the port from now on, and not press on at once in the next seat.

        The unit has slid out of the port. Friction acts against the motion over the floor, and that of wheels
        that spin is along the wheels: they push as hard at any speed, but on a slope the unit slides to the
        side in proportion to it. The pins still have to come all the way into the holes in the time without
        progress that is granted.
        """
        least = self.setup.pin_reach / (self.spec.stall_time_s * self.spec.press_mps)
        self.speed_share *= max(self.tuning.slower_share, min(1.0, least / self.speed_share))
        self.presses = False

    def observe(self, observation: Observation) -> None:
        """Take in what is known at this instant; called once an instant."""
        now_ns, pose = observation.now_ns, observation.pose
        if self._previous_ns is not None and now_ns > self._previous_ns:
            self.dt = seconds(now_ns - self._previous_ns)
        self._previous_ns, self.observation = now_ns, observation
        self.turned += self.dt * observation.twist.w
        if pose is None:
            self.view = None
            if self.last_gap is not None:
                self.last_gap -= self.dt * observation.twist.v
            return
        self.view = PortView.of(pose, observation.los, self.setup, now_ns)
        self.last_gap, self.ever_seen = self.view.gap, True

    def reached_bottom(self, left: bool, right: bool) -> None:
        """Take in which seat switches have closed as the first ones of this attempt."""
        self.was_in_holes = True
        self.came_turned = _ASIDE * self.memory.sigma_yaw * (right - left)

    def slid(self) -> None:
        """Aim at another heading in the next attempt, after the unit has slid out of the port.

        Had both pins come to the bottom at once, it would have stood still there, held by wheels at rest.
        """
        if self.came_turned:
            self.aim.turned(abs(self.came_turned), self.came_turned > 0.0)

    def jammed(self, to_left: bool) -> None:
        """Aim elsewhere in the next attempt, after the pins have jammed and turned the unit to one side.

        A unit whose sight is off by more than it knows would try the same place again. So it goes aside at
        least by the width of the rim of a mouth, in which a pin may jam: one that stopped on the edge comes
        to where the funnel still centres it, and one that was in the middle stays where it does.

        Holes turn a unit about its pins, as its wheels do not slide sideways: the axle is as far to the side
        as the angle of that turn has moved the pins ahead of it. Where the pins have stopped before the
        holes, only how uncertain sight was tells how far to the side the port may be.
        """
        rim = (1.0 - self.tuning.capture_share) * self.setup.mouth
        step = max(_ASIDE * self.memory.sigma_lateral, rim)
        if self.gap > self.setup.pin_reach - self.tuning.contact_m:
            self.aim.stopped(step, to_left)
            return
        if self.view is not None:
            turned = self.view.yaw if to_left else -self.view.yaw
            step = min(step, max(self.setup.offset * math.sin(turned), rim))
        if self.aim.jammed(step, to_left):
            # The port is farther to that side, or the unit comes in turned to it.
            self.aim.turned(_ASIDE * self.memory.sigma_yaw, to_left)

    def backing_out(self, pose: PoseEstimate, distance: float) -> Twist:
        """Return the command that backs the unit out to a distance between the faces [m]."""
        v, w = retreat_twist(self._aimed(pose).X_DU.as_array(), distance, self.tuning.retreat, self.setup)
        return Twist(float(v), float(w))

    def control_inputs(self, pose: PoseEstimate) -> ControlInputs:
        """Return what the controller is given at this instant."""
        return ControlInputs(
            self.now_ns, self.dt, self._aimed(pose), self.observation.los, self.observation.twist
        )

    def _aimed(self, pose: PoseEstimate) -> PoseEstimate:
        """Return the pose relative to where the unit docks beside the axis."""
        if not self.aim.lateral and not self.aim.yaw:
            return pose
        return replace(pose, X_DU=self.aim.X_DA.inverse() @ pose.X_DU)
