"""The phase machine of one docking step, from the first look to the verified lock.

::

    ASSEMBLE -> HAND_OVER -> DOCK -> LOCK -> VERIFY -> DONE
     ^  |         ^   |       |       |        |
     |  |         |   +-------+-------+--------+--> RETREAT -> FAILED   (no attempt left)
     |  |         +-----------------------------------+   (next attempt)
     |  +--> FAILED  (no way, or not localised)       |
     +------------------------------------------------+   (next attempt, the hand-over itself having failed)

Each phase is one method: it returns a twist to stay, or a :class:`Move` to another phase. The unit decides by
estimates and its own sensors alone. Without a long-distance phase (the unit starts in front of the port)
every attempt begins at the hand-over.
"""

from __future__ import annotations

import math

import numpy as np

from msrr_control.controller import ControlInputs, Controller
from msrr_control.law import DockSetup
from msrr_control.phase_tuning import PhaseTuning
from msrr_control.phase_visit import Move, Visit
from msrr_control.port_view import PortView
from msrr_control.retreat import retreat_twist
from msrr_control.search import scan_angle, turn_rate
from msrr_control.senses import Assembler, GiveUp, Senses
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import (
    Action,
    Belief,
    Conviction,
    LockPosition,
    Phase,
    PoseEstimate,
    Setback,
    Twist,
    seconds,
)
from msrr_scenes.plan import DockingSpec

_STILL = Twist()
_HOLDS_LOCK = frozenset({Phase.LOCK, Phase.VERIFY, Phase.DONE})


class PhaseMachine:
    """Decides what the docking unit does at every control instant.

    Attributes:
        belief: What the unit says about this docking step so far.
    """

    def __init__(
        self,
        spec: DockingSpec,
        setup: DockSetup,
        controller: Controller,
        assembler: Assembler | None = None,
        tuning: PhaseTuning | None = None,
    ) -> None:
        """Begin before the first attempt.

        Args:
            spec: Attempts, times and speeds of the task.
            setup: Facts of the docking step.
            controller: Drives from the hand-over to the port.
            assembler: The long-distance phase; None if the unit starts in front of the port.
            tuning: Figures of the mechanism and the sensors.
        """
        self.belief = Belief()
        self._spec = spec
        self._setup = setup
        self._controller = controller
        self._assembler = assembler
        self._tuning = tuning if tuning is not None else PhaseTuning()
        self._phases = {
            Phase.ASSEMBLE: self._assemble,
            Phase.HAND_OVER: self._hand_over,
            Phase.DOCK: self._dock,
            Phase.LOCK: self._lock,
            Phase.VERIFY: self._verify,
            Phase.RETREAT: self._retreat,
            Phase.DONE: self._rest,
            Phase.FAILED: self._rest,
        }
        self._phase, self._reason, self._attempt = Phase.ASSEMBLE, "start", 1
        self._visit: Visit | None = None
        self._undocking = False
        self._reassemble = False  # the hand-over failed: the next attempt begins with the long-distance phase
        self._ever_seen = False
        self._gap: float | None = None  # last known, moved on by odometry when the estimate is gone
        self._then_ns: int | None = None
        self._dt = 1.0 / setup.rate_hz

    @property
    def phase(self) -> Phase:
        """The phase that the last step ended in."""
        return self._phase

    @property
    def attempt(self) -> int:
        """The attempt under way, counted from 1."""
        return self._attempt

    @property
    def finished(self) -> bool:
        """The step is over: done or failed."""
        return self._phase in (Phase.DONE, Phase.FAILED)

    def undock(self) -> None:
        """Open the lock and back out, from the next step on.

        Raises:
            MsrrError: The unit is not docked as far as it knows.
        """
        if self.belief.conviction is not Conviction.DOCKED:
            raise MsrrError(f"cannot undock in phase {self._phase.value!r}: the unit is not docked")
        self.belief = Belief()
        self._undocking = True
        self._phase, self._reason, self._visit = Phase.RETREAT, "undock", None

    def step(self, senses: Senses) -> Action:
        """Decide at one control instant.

        Args:
            senses: What is known now; time does not run backwards.

        Returns:
            Phase, lock and command; the twist is within the drive's limits, those of the close range once
            the long-distance phase is over.

        Raises:
            MsrrError: The controller returned something that is no number.
        """
        if self._then_ns is not None and senses.now_ns > self._then_ns:
            self._dt = seconds(senses.now_ns - self._then_ns)
        self._then_ns = senses.now_ns
        view = self._look(senses)
        twist = _STILL
        for _ in Phase:  # a phase that has nothing to do is passed in the same instant; none comes twice
            if self._visit is None:
                self._visit = Visit(senses.now_ns)
                self._enter(senses)
            decision = self._phases[self._phase](senses, view, self._visit)
            if isinstance(decision, Twist):
                twist = decision
                break
            retreated = self._phase is Phase.RETREAT
            self._change(decision)
            if retreated:  # what comes of it, and why, is to be seen for one instant
                break
        return Action(
            stamp_ns=senses.now_ns,
            phase=self._phase,
            attempt=self._attempt,
            twist=self._limited(twist),
            lock=self._phase in _HOLDS_LOCK and not self._undocking,
            reason=self._reason,
        )

    # The phases, in the order in which they come.

    def _assemble(self, senses: Senses, view: PortView | None, visit: Visit) -> Twist | Move:
        """Bring the unit in front of the port; passed at once if it starts there."""
        if self._assembler is None:
            return Move(Phase.HAND_OVER, "starts in front of the port")
        decision = self._assembler.step(senses)
        if decision is None:
            return Move(Phase.HAND_OVER, "assembled in front of the port")
        if isinstance(decision, GiveUp):
            return Move(Phase.FAILED, decision.reason, decision.setback)
        return decision

    def _hand_over(self, senses: Senses, view: PortView | None, visit: Visit) -> Twist | Move:
        """Wait for a good look at the target; search when it is not seen."""
        tuning, spin = self._tuning, self._setup.limits.w_max_radps
        visit.turned += self._dt * senses.twist.w
        unseen = visit.unseen.update(view is None or view.age > self._spec.lost_time_s, senses.now_ns)
        if view is None or unseen >= 0.0:
            if unseen > self._spec.search_time_s:
                if self._ever_seen:
                    return self._back_to_assembly(f"target not found in {unseen:.1f} s", Setback.TARGET_LOST)
                why = f"no marker seen in {unseen:.1f} s"
                if self._assembler is None:
                    return Move(Phase.FAILED, why, Setback.NEVER_DETECTED)
                return self._back_to_assembly(why, Setback.NEVER_DETECTED)
            middle = view.bearing if view is not None else -visit.turned
            wanted = middle + scan_angle(unseen, self._spec.search_time_s, tuning.search)
            return Twist(0.0, turn_rate(wanted, tuning.search, spin))
        visit.turned = 0.0
        in_cone = view.widest_edge < self._setup.los.outer
        certain = view.sigma_lateral <= tuning.ready_sigma_m and view.sigma_yaw <= tuning.ready_sigma
        if in_cone and certain:
            return Move(Phase.DOCK, f"target seen at {view}")
        if visit.lasted(senses.now_ns) > tuning.ready_time_s:
            why = "uncertain" if in_cone else "outside the cone"
            return self._back_to_assembly(f"target seen but {why} at {view}", Setback.UNREADY)
        creep = tuning.search.creep_mps if in_cone and view.gap > tuning.search.creep_gap_m else 0.0
        return Twist(creep, turn_rate(view.bearing, tuning.search, spin))

    def _dock(self, senses: Senses, view: PortView | None, visit: Visit) -> Twist | Move:
        """Follow the controller to the port, then press until the pins are at the bottom of the holes."""
        spec, tuning, now = self._spec, self._tuning, senses.now_ns
        if view is None or senses.pose is None or view.age > spec.lost_time_s:
            return Move(Phase.RETREAT, f"target lost for {spec.lost_time_s:.2f} s", Setback.TARGET_LOST)
        at_port = view.gap <= self._setup.pin_reach + tuning.contact_m
        closed = senses.switches is not None and senses.switches.both
        agrees = abs(view.gap - tuning.seated_gap_m) <= tuning.near_m or not spec.verify.by_sight
        if visit.switches.update(closed and at_port and agrees, now) >= tuning.debounce_s:
            return Move(Phase.LOCK, f"both seat switches closed at {view}")
        idle = visit.without_progress(view.off_seat(tuning.seated_gap_m), tuning.progress_m, now)
        if idle > spec.stall_time_s:
            return Move(Phase.RETREAT, f"no progress for {idle:.1f} s at {view}", Setback.STALLED)
        twist = self._controller.step(self._inputs(senses, senses.pose))
        if not at_port:
            return twist
        if abs(view.lateral) > tuning.capture_m or abs(view.yaw) > tuning.capture:
            return Move(Phase.RETREAT, f"too far off the axis at {view}", Setback.OFF_AXIS)
        turn = min(max(twist.w, -tuning.press_turn_radps), tuning.press_turn_radps)
        return Twist(spec.press_mps, turn)

    def _lock(self, senses: Senses, view: PortView | None, visit: Visit) -> Twist | Move:
        """Close the cam; lean on the port without pushing."""
        tuning = self._tuning
        opened = senses.switches is None or not senses.switches.both
        if visit.switches.update(opened, senses.now_ns) > tuning.debounce_s:
            return Move(Phase.RETREAT, "seat switches opened while the cam closed", Setback.NOT_LATCHED)
        if self._cam(senses, LockPosition.CLOSED, visit.since_ns):
            return Move(Phase.VERIFY, f"cam closed after {visit.lasted(senses.now_ns):.2f} s")
        if visit.lasted(senses.now_ns) > tuning.latch_s:
            return Move(Phase.RETREAT, f"cam not closed in {tuning.latch_s:.1f} s", Setback.NOT_LATCHED)
        return Twist(tuning.hold_share * self._spec.press_mps, 0.0)

    def _verify(self, senses: Senses, view: PortView | None, visit: Visit) -> Twist | Move:
        """Compare what is seen with a seated unit."""
        check, tuning = self._spec.verify, self._tuning
        if not check.by_sight:
            return Move(Phase.DONE, "seat switches and cam closed")
        if view is not None:
            seated = view.off_seat(tuning.seated_gap_m) <= check.position_m
            straight = abs(view.yaw) <= math.radians(check.yaw_deg)
            if visit.frames_in_a_row(view.last_seen_ns, seated and straight) >= tuning.frames:
                return Move(Phase.DONE, f"locked, and seen seated at {view}")
        if visit.lasted(senses.now_ns) > check.time_s:
            seen = f"seen at {view}" if view is not None else "not seen"
            return Move(Phase.RETREAT, f"locked, but {seen}", Setback.NOT_VERIFIED)
        return _STILL

    def _retreat(self, senses: Senses, view: PortView | None, visit: Visit) -> Twist | Move:
        """Open the lock, back out, and try again or give up."""
        spec, tuning, now = self._spec, self._tuning, senses.now_ns
        gap = self._gap if self._gap is not None else spec.retreat_m
        is_open = senses.lock is None or senses.lock.position is LockPosition.OPEN
        if visit.opened.update(is_open or visit.lasted(now) > tuning.unlatch_s, now) < 0.0:
            return _STILL
        longest = spec.retreat_m / tuning.retreat.speed_mps + tuning.retreat_margin_s
        there = gap >= spec.retreat_m - tuning.arrived_m or visit.lasted(now) > longest
        stands = visit.arrived.update(there, now)
        if stands >= tuning.settle_s:
            return self._after_retreat(gap)
        if there:
            return _STILL
        if senses.pose is None:
            return Twist(-tuning.retreat.speed_mps, 0.0)
        X = senses.pose.X_DU
        v, w = retreat_twist(np.array([X.x, X.y, X.yaw]), spec.retreat_m, tuning.retreat, self._setup)
        return Twist(float(v), float(w))

    def _rest(self, senses: Senses, view: PortView | None, visit: Visit) -> Twist | Move:
        return _STILL

    # What they share.

    def _after_retreat(self, gap: float) -> Move:
        if self._undocking:
            return Move(Phase.DONE, f"undocked, {gap:.3f} m away")
        if self._attempt < self._spec.attempts:
            self._attempt += 1
            again = f"attempt {self._attempt} from {gap:.3f} m: {self.belief.reason}"
            if self._reassemble and self._assembler is not None:
                self._reassemble, self._gap = False, None
                self._assembler.reset(self.belief.reason)
                return Move(Phase.ASSEMBLE, again)
            return Move(Phase.HAND_OVER, again)
        return Move(
            Phase.FAILED, f"gave up after {self._attempt} attempts: {self.belief.reason}", self.belief.setback
        )

    def _back_to_assembly(self, reason: str, setback: Setback) -> Move:
        """Leave a hand-over that failed: back out if near, then come again from afar if the unit can."""
        self._reassemble = True
        return Move(Phase.RETREAT, reason, setback)

    def _change(self, move: Move) -> None:
        """Take up another phase and say what that means."""
        self._phase, self._reason, self._visit = move.to, move.reason, None
        if move.to is Phase.DONE:
            said = Conviction.UNDOCKED if self._undocking else Conviction.DOCKED
            self.belief = Belief(said, None, move.reason)
        elif move.to is Phase.FAILED:
            self.belief = Belief(Conviction.GAVE_UP, move.setback, move.reason)
        elif move.setback is not None:
            self.belief = Belief(Conviction.UNDECIDED, move.setback, move.reason)

    def _enter(self, senses: Senses) -> None:
        if self._phase is Phase.DOCK and senses.pose is not None:
            self._controller.reset(self._inputs(senses, senses.pose))

    def _look(self, senses: Senses) -> PortView | None:
        if senses.pose is None:
            if self._gap is not None:
                self._gap -= self._dt * senses.twist.v
            return None
        view = PortView.of(senses.pose, senses.los, self._setup, senses.now_ns)
        self._gap, self._ever_seen = view.gap, True
        return view

    def _inputs(self, senses: Senses, pose: PoseEstimate) -> ControlInputs:
        return ControlInputs(senses.now_ns, self._dt, pose, senses.los, senses.twist)

    def _cam(self, senses: Senses, position: LockPosition, since_ns: int) -> bool:
        """Say whether the cam has reported ``position`` since the phase began."""
        lock = senses.lock
        return lock is not None and lock.position is position and lock.stamp_ns >= since_ns

    def _limited(self, twist: Twist) -> Twist:
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            raise MsrrError(f"a law commanded {twist} in phase {self._phase.value}")
        limits = self._setup.limits
        v = limits.v_max_mps if self._phase is Phase.ASSEMBLE else limits.v_close_mps
        w = limits.w_max_radps
        return Twist(min(max(float(twist.v), -v), v), min(max(float(twist.w), -w), w))
