"""What the states of a docking step share: transitions, the memory of one stay, and their context."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from msrr_control.docking.controller import ControlInputs, Controller
from msrr_control.docking.law import DockSetup
from msrr_control.docking.retreat import retreat_twist
from msrr_control.sequence.aim import Aim
from msrr_control.sequence.observation import Assembler, Observation
from msrr_control.sequence.port_view import PortView
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
        seen_s: Time for which the target has been seen, all in all, without a slow approach to it [s].
        crept_s: Time of the slow approach to the target since it was last seen [s].
        unseen: Timer of the target being unseen.
        switches: Timer of the seat switches saying what the phase waits for.
        parted: Timer of the seat switches being open at the port after one of them had closed there.
        parted_gap: Gap at which they opened [m].
        opened: Timer of the lock being open.
        looked_behind: Timer of the unit knowing what is behind it, or no longer waiting to know.
        arrived: Timer of the unit standing at the end of its retreat or tug.
        backing: What was observed when the unit was last commanded to back out: the collision monitor lets a
            command to stand still pass, whatever is near.
        leg: Leg of the calibration drive under way, counted from 0.
        limited: Timer of the collision monitor slowing or stopping the unit.
        doubted: Timer of the collision monitor stopping it because nobody knows where others are.
        sigma_lateral: Smallest standard deviation of the lateral estimate [m] on the way to the port, near
            which wheels that may spin make it larger; 0 in a stay that begins there.
        sigma_yaw: That of the heading [rad].
        pushed: Way that the unit was let push on at the port since it last made progress [m].
        before: View before a tug test; None in other phases.
        tugged: Way that the unit was let drive backwards in a tug test [m].
        frames: Number of frames in a row that agreed, as :meth:`frames_in_a_row` has counted them.
    """

    def __init__(self, since_ns: int) -> None:
        """Begin a stay."""
        self.since_ns = since_ns
        self.seen_s, self.leg = 0.0, 0
        self.crept_s = 0.0
        self.unseen, self.switches, self.arrived = HoldTimer(), HoldTimer(), HoldTimer()
        self.opened, self.looked_behind, self.limited = HoldTimer(), HoldTimer(), HoldTimer()
        self.doubted, self.parted = HoldTimer(), HoldTimer()
        self.backing: Observation | None = None
        self.sigma_lateral = self.sigma_yaw = self.pushed = self.parted_gap = 0.0
        self.before: PortView | None = None
        self.tugged = 0.0
        self._best, self._best_ns = math.inf, since_ns
        self.frames, self._last_frame_ns = 0, since_ns

    def lasted(self, now_ns: int) -> float:
        """Return the time [s] since the phase was entered."""
        return seconds(now_ns - self.since_ns)

    def without_progress(self, remaining: float, smallest: float, way: float, now_ns: int) -> float:
        """Return the time [s] since ``remaining`` [m] last made progress.

        Progress is a fall by ``way`` [m], or to half of where it began, and by ``smallest`` [m] at least.
        """
        if remaining < self._best - self.next_progress(smallest, way):
            self._best, self._best_ns, self.pushed = remaining, now_ns, 0.0
        return seconds(now_ns - self._best_ns)

    def next_progress(self, smallest: float, way: float) -> float:
        """Return the fall that counts as progress next [m]; see :meth:`without_progress`."""
        return max(smallest, min(way, 0.5 * self._best))

    def pause(self, now_ns: int) -> None:
        """Let the time without progress begin anew: nothing can be expected of the unit now."""
        self._best_ns = now_ns

    def slowed(self, share: float, dt: float) -> None:
        """Let the time without progress run by a share of ``dt`` [s]: the unit drives at that share only."""
        self._best_ns += round(1e9 * (1.0 - share) * dt)

    def frames_in_a_row(self, exposed_ns: int, agrees: bool) -> int:
        """Count the frames exposed since the phase began that agree, from the last one that did not."""
        if exposed_ns > self._last_frame_ns:
            self._last_frame_ns = exposed_ns
            self.frames = self.frames + 1 if agrees else 0
        return self.frames


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
        distrusts: Whether the seat switches were closed away from the port, or before they should: they tell
            nothing of a seat.
        closed_gap: Gap that was seen when both seat switches closed [m]; None while one of them is open.
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
    closed_gap: float | None = None
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
        self.aim.jammed(step, to_left)

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
