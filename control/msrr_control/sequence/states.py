"""What the docking unit does in each phase in front of the port; which phase comes, the phase machine says.

Each phase is one method: it returns a twist to stay, or a :class:`Transition` to another phase.
"""

from __future__ import annotations

import math

import numpy as np

from msrr_control.docking.controller import ControlInputs, Controller
from msrr_control.docking.law import DockSetup
from msrr_control.docking.retreat import retreat_twist
from msrr_control.sequence.memory import StateMemory, Transition
from msrr_control.sequence.observation import Observation
from msrr_control.sequence.port_view import PortView
from msrr_control.sequence.search import scan_angle, turn_rate
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.messages import FailureReason, LockPosition, Phase, PoseEstimate, Twist, seconds
from msrr_scenes.specs.plan import DockingSpec

STILL = Twist()


class DockingPhases:
    """From the first look at the target to the verified lock, and back out of the port."""

    def __init__(
        self,
        spec: DockingSpec,
        setup: DockSetup,
        controller: Controller,
        tuning: PhaseTuning,
        comes_from_afar: bool,
    ) -> None:
        """Begin before the first look.

        Args:
            spec: Attempts, times and speeds of the task.
            setup: Facts of the docking step.
            controller: Drives from the hand-over to the port.
            tuning: Figures of the mechanism and the sensors.
            comes_from_afar: Whether there is an overhead camera: the unit can come again from afar where the
                hand-over fails, and looks around before it backs out.
        """
        self._spec, self._setup, self._controller, self._tuning = spec, setup, controller, tuning
        self._comes_from_afar = comes_from_afar
        self._ever_seen = False
        self._gap: float | None = None  # last known, moved on by odometry when the estimate is gone
        self._then_ns: int | None = None
        self._dt = 1.0 / setup.rate_hz

    @property
    def gap(self) -> float:
        """Distance between the faces as last known [m]; that of a finished retreat while none is."""
        return self._gap if self._gap is not None else self._spec.retreat_m

    def forget_gap(self) -> None:
        """Take the gap for unknown: the unit goes far away."""
        self._gap = None

    def look(self, senses: Observation) -> PortView | None:
        """Return where the port is at this instant, None while nothing is known; to be asked at each."""
        if self._then_ns is not None and senses.now_ns > self._then_ns:
            self._dt = seconds(senses.now_ns - self._then_ns)
        self._then_ns = senses.now_ns
        if senses.pose is None:
            if self._gap is not None:
                self._gap -= self._dt * senses.twist.v
            return None
        view = PortView.of(senses.pose, senses.los, self._setup, senses.now_ns)
        self._gap, self._ever_seen = view.gap, True
        return view

    def begin_approach(self, senses: Observation) -> None:
        """Let the controller begin an approach from here."""
        if senses.pose is not None:
            self._controller.reset(self._inputs(senses, senses.pose))

    def hand_over(self, senses: Observation, view: PortView | None, visit: StateMemory) -> Twist | Transition:
        """Wait for a good look at the target; search when it is not seen."""
        tuning, spin = self._tuning, self._setup.limits.w_max_radps
        visit.turned += self._dt * senses.twist.w
        unseen = visit.unseen.update(view is None or view.age > self._spec.lost_time_s, senses.now_ns)
        if view is None or unseen >= 0.0:
            if unseen > self._spec.search_time_s:
                if self._ever_seen:
                    return _come_again(f"target not found in {unseen:.1f} s", FailureReason.TARGET_LOST)
                why = f"no marker seen in {unseen:.1f} s"
                if not self._comes_from_afar:
                    return Transition(Phase.FAILED, why, FailureReason.NEVER_DETECTED)
                return _come_again(why, FailureReason.NEVER_DETECTED)
            middle = view.bearing if view is not None else -visit.turned
            wanted = middle + scan_angle(unseen, self._spec.search_time_s, tuning.search)
            return Twist(0.0, turn_rate(wanted, tuning.search, spin))
        visit.turned = 0.0
        in_cone = view.widest_edge < self._setup.los.outer
        certain = view.sigma_lateral <= tuning.ready_sigma_m and view.sigma_yaw <= tuning.ready_sigma
        if in_cone and certain:
            return Transition(Phase.DOCK, f"target seen at {view}")
        if visit.lasted(senses.now_ns) > tuning.ready_time_s:
            why = "uncertain" if in_cone else "outside the cone"
            return _come_again(f"target seen but {why} at {view}", FailureReason.UNREADY)
        creep = tuning.search.creep_mps if in_cone and view.gap > tuning.search.creep_gap_m else 0.0
        return Twist(creep, turn_rate(view.bearing, tuning.search, spin))

    def dock(self, senses: Observation, view: PortView | None, visit: StateMemory) -> Twist | Transition:
        """Follow the controller to the port, then press until the pins are at the bottom of the holes."""
        spec, tuning, now = self._spec, self._tuning, senses.now_ns
        if view is None or senses.pose is None or view.age > spec.lost_time_s:
            return Transition(
                Phase.RETREAT, f"target lost for {spec.lost_time_s:.2f} s", FailureReason.TARGET_LOST
            )
        at_port = view.gap <= self._setup.pin_reach + tuning.contact_m
        closed = senses.switches is not None and senses.switches.both
        agrees = abs(view.gap - tuning.seated_gap_m) <= tuning.near_m or not spec.verify.by_sight
        if visit.switches.update(closed and at_port and agrees, now) >= tuning.debounce_s:
            return Transition(Phase.LOCK, f"both seat switches closed at {view}")
        idle = visit.without_progress(view.off_seat(tuning.seated_gap_m), tuning.progress_m, now)
        if idle > spec.stall_time_s:
            return Transition(Phase.RETREAT, f"no progress for {idle:.1f} s at {view}", FailureReason.STALLED)
        twist = self._controller.step(self._inputs(senses, senses.pose))
        if not at_port:
            return twist
        if abs(view.lateral) > tuning.capture_m or abs(view.yaw) > tuning.capture:
            return Transition(Phase.RETREAT, f"too far off the axis at {view}", FailureReason.OFF_AXIS)
        turn = min(max(twist.w, -tuning.press_turn_radps), tuning.press_turn_radps)
        return Twist(spec.press_mps, turn)

    def lock(self, senses: Observation, view: PortView | None, visit: StateMemory) -> Twist | Transition:
        """Close the cam; lean on the port without pushing."""
        tuning = self._tuning
        opened = senses.switches is None or not senses.switches.both
        if visit.switches.update(opened, senses.now_ns) > tuning.debounce_s:
            return Transition(
                Phase.RETREAT, "seat switches opened while the cam closed", FailureReason.NOT_LATCHED
            )
        if self._cam(senses, LockPosition.CLOSED, visit.since_ns):
            return Transition(Phase.VERIFY, f"cam closed after {visit.lasted(senses.now_ns):.2f} s")
        if visit.lasted(senses.now_ns) > tuning.latch_s:
            return Transition(
                Phase.RETREAT, f"cam not closed in {tuning.latch_s:.1f} s", FailureReason.NOT_LATCHED
            )
        return Twist(tuning.hold_share * self._spec.press_mps, 0.0)

    def verify(self, senses: Observation, view: PortView | None, visit: StateMemory) -> Twist | Transition:
        """Compare what is seen with a seated unit."""
        check, tuning = self._spec.verify, self._tuning
        if not check.by_sight:
            return Transition(Phase.DONE, "seat switches and cam closed")
        if view is not None:
            seated = view.off_seat(tuning.seated_gap_m) <= check.position_m
            straight = abs(view.yaw) <= math.radians(check.yaw_deg)
            if visit.frames_in_a_row(view.last_seen_ns, seated and straight) >= tuning.frames:
                return Transition(Phase.DONE, f"locked, and seen seated at {view}")
        if visit.lasted(senses.now_ns) > check.time_s:
            seen = f"seen at {view}" if view is not None else "not seen"
            return Transition(Phase.RETREAT, f"locked, but {seen}", FailureReason.NOT_VERIFIED)
        return STILL

    def back_out(self, senses: Observation, visit: StateMemory) -> Twist | None:
        """Open the lock, look around and back out; None once the unit has come to rest.

        The unit's own camera does not show where it backs out to. The unit waits for an overhead picture
        exposed after the decision to back out, so that whoever guards its commands knows of what has come up
        behind it; without one for too long it goes by what it knew before.
        """
        spec, tuning, now = self._spec, self._tuning, senses.now_ns
        gap = self.gap
        is_open = senses.lock is None or senses.lock.position is LockPosition.OPEN
        opened = visit.opened.update(is_open or visit.lasted(now) > tuning.unlatch_s, now)
        overlooked = visit.overlooked.update(self._has_looked_around(senses, visit), now)
        free = min(opened, overlooked)
        if free < 0.0:
            return STILL
        longest = spec.retreat_m / tuning.retreat.speed_mps + tuning.retreat_margin_s
        there = gap >= spec.retreat_m - tuning.arrived_m or free > longest
        stands = visit.arrived.update(there, now)
        if stands >= tuning.settle_s:
            return None
        if there:
            return STILL
        if senses.pose is None:
            return Twist(-tuning.retreat.speed_mps, 0.0)
        X = senses.pose.X_DU
        v, w = retreat_twist(np.array([X.x, X.y, X.yaw]), spec.retreat_m, tuning.retreat, self._setup)
        return Twist(float(v), float(w))

    def _has_looked_around(self, senses: Observation, visit: StateMemory) -> bool:
        """Say whether an overhead picture of this visit has arrived, or is not to be waited for."""
        if not self._comes_from_afar or visit.lasted(senses.now_ns) > self._tuning.look_around_s:
            return True
        return senses.looked_around_ns is not None and senses.looked_around_ns > visit.since_ns

    def _inputs(self, senses: Observation, pose: PoseEstimate) -> ControlInputs:
        return ControlInputs(senses.now_ns, self._dt, pose, senses.los, senses.twist)

    def _cam(self, senses: Observation, position: LockPosition, since_ns: int) -> bool:
        """Say whether the cam has reported ``position`` since the phase began."""
        lock = senses.lock
        return lock is not None and lock.position is position and lock.stamp_ns >= since_ns


def _come_again(reason: str, setback: FailureReason) -> Transition:
    """Leave a hand-over that failed: back out if near, then come again from afar if the unit can."""
    return Transition(Phase.RETREAT, reason, setback, reassemble=True)
