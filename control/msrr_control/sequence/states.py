"""What the docking unit does on its way to the port, in it until its lock has closed, and away from it.

Each function stands for one phase: it returns a twist to stay in the phase, or a :class:`Transition` to
another. :mod:`msrr_control.sequence.state_machine` has the table of all phases.
"""

from __future__ import annotations

import math

from msrr_control.docking.controller import promised_speed
from msrr_control.sequence.calibration_drive import calibration_twist
from msrr_control.sequence.context import STILL, DockingContext, Transition
from msrr_control.sequence.evidence import (
    has_looked_behind,
    in_seat_range,
    lock_is_open,
    not_parted,
    not_undocked,
    with_doubt,
)
from msrr_control.sequence.observation import GiveUp
from msrr_scenes.messages import (
    CollisionMonitorState,
    FailureReason,
    LockPosition,
    MonitorState,
    Phase,
    Twist,
)
from msrr_scenes.wording import counted

#: Share of the pins' length: at a smaller gap the pins are in the holes, and where the unit is to the side is
#: no matter of sight, which goes wrong there with wheels that spin while the unit stands.
_IN_HOLES = 0.5

#: Failures of a unit that is no longer in its seat, or in the holes. On a floor that holds its wheels it
#: would most likely have stayed there.
_SLIPPED = {FailureReason.OFF_AXIS, FailureReason.NOT_VERIFIED}

#: Clearance beyond which a body stops no unit that knows where it is [m]: units stop within a tenth of that,
#: and no place is as uncertain that somebody has seen in the last seconds.
_FAR_M = 0.3


def assemble(c: DockingContext) -> Twist | Transition:
    """Let the long-distance phase bring the unit in front of the port; pass on if it starts there."""
    if c.assembler is None:
        return Transition(Phase.HAND_OVER, "starts in front of the port")
    decision = c.assembler.step(c.observation)
    if decision is None:
        return Transition(Phase.HAND_OVER, "assembled in front of the port")
    if isinstance(decision, GiveUp):
        return Transition(Phase.FAILED, decision.reason, decision.failure)
    c.turned = 0.0
    return decision


def begin_approach(c: DockingContext) -> None:
    """Let the controller begin an approach from here."""
    c.approached = True
    if c.observation.pose is not None:
        c.controller.reset(c.control_inputs(c.observation.pose))


def calibrate(c: DockingContext) -> Twist | Transition:
    """Drive in front of the port until the estimator knows camera and wheels better, then begin anew.

    Turned away, the unit may see the target no longer; it then turns on by its wheels.
    """
    twist = calibration_twist(c, c.tuning.calibration)
    if twist is not None:
        return twist
    c.calibrate = False
    return Transition(Phase.HAND_OVER, f"drove for {c.memory.lasted(c.now_ns):.1f} s to calibrate")


def dock(c: DockingContext) -> Twist | Transition:
    """Follow the controller to the port, then press until the pins are at the bottom of the holes."""
    view, pose, switches = c.view, c.observation.pose, c.observation.switches
    spec, tuning, now_ns = c.spec, c.tuning, c.now_ns
    if view is None or pose is None or view.age > spec.lost_time_s:
        return Transition.back_out(f"target lost for {spec.lost_time_s:.2f} s", FailureReason.TARGET_LOST)
    at_port = view.gap <= c.setup.pin_reach + tuning.contact_m
    closed = c.observation.both_closed
    tugs = spec.verify.by_sight and spec.verify.tug_m > 0.0
    if tugs and closed and view.gap > with_doubt(c.setup.pin_reach + tuning.contact_m, view.sigma_gap):
        c.distrusts = True
    any_closed = switches is not None and (switches.left or switches.right)
    if any_closed and not c.was_in_holes and switches is not None:
        c.reached_bottom(switches.left, switches.right)
    if not closed:
        c.closed_gap = None
    elif c.closed_gap is None:
        c.closed_gap = view.gap
    if not at_port:
        c.memory.sigma_lateral = min(c.memory.sigma_lateral or math.inf, view.sigma_lateral)
        c.memory.sigma_yaw = min(c.memory.sigma_yaw or math.inf, view.sigma_yaw)
    near = with_doubt(tuning.near_m, view.sigma_gap)
    agrees = in_seat_range(view.gap - tuning.seated_gap_m, near) or not spec.verify.by_sight
    agrees = agrees and not c.distrusts  # then the unit presses for as long as it gets on
    if c.memory.switches.update(closed and at_port and agrees, now_ns) >= tuning.debounce_s:
        return Transition(Phase.LOCK, f"both seat switches closed at {view}")
    # If any progress counted, the unit could creep for minutes: it has to keep a share of the promised speed,
    # or near the seat to halve what is left.
    monitor = c.observation.monitor
    doubted_s = c.memory.doubted.update(_held_by_doubt(monitor), now_ns)
    if doubted_s > tuning.doubt_s:
        reason = f"held for {doubted_s:.0f} s by the collision monitor: {monitor}, at {view}"
        return Transition.back_out(reason, FailureReason.STALLED, reassemble=True)
    if doubted_s >= 0.0:  # until somebody sees them again; another attempt would be held as well
        c.memory.pause(now_ns)
    way = tuning.progress_share * promised_speed(c.controller, c.setup.limits) * spec.stall_time_s
    idle = c.memory.without_progress(view.off_seat(tuning.seated_gap_m), tuning.progress_m, way, now_ns)
    limited_s = c.memory.limited.update(monitor is not None and monitor.limits, now_ns)
    if at_port:
        passed = c.observation.passed
        c.memory.pushed += c.dt * (c.press_mps if passed is None else passed.v)
    # Pins hold only a unit that the monitor let push on by more than what counts as progress.
    pressed = at_port and c.memory.pushed > c.memory.next_progress(tuning.progress_m, way)
    parted_s = c.memory.parted.update(at_port and c.was_in_holes and not any_closed, now_ns)
    if parted_s <= 0.0:
        c.memory.parted_gap = view.gap
    # Pressing on would turn it on, towards what stands beside the port.
    if parted_s > tuning.parted_s and view.gap >= c.memory.parted_gap:
        c.slid()
        return Transition.back_out(f"slid out of the port as it pressed, at {view}", FailureReason.OFF_AXIS)
    if idle > spec.stall_time_s:
        if closed and at_port and tugs:
            # Sight may be what is wrong, and would be so in the next attempt as well; a tug test tells.
            away = "; they were closed away from the port, too" if c.distrusts else ""
            return Transition(Phase.LOCK, f"both seat switches closed, although seen at {view}{away}")
        # The first decision of the monitor comes with the next instant.
        held = limited_s >= idle - 2.0 * c.dt
        if held:  # the same approach would end here again; the long-distance phase knows what stands where
            reason = f"held for {idle:.1f} s by the collision monitor: {monitor}, at {view}"
        else:
            reason = f"no progress for {idle:.1f} s at {view}"
        if pressed and not closed:
            # The pin that is farther in tells how the unit is turned: sight may be off by more than that.
            to_left = switches.right if any_closed and switches is not None else view.yaw > 0.0
            c.jammed(to_left)
        return Transition.back_out(reason, FailureReason.STALLED, reassemble=held)
    twist = c.controller.step(c.control_inputs(pose))
    if not at_port:
        return _slowed(c, twist, view.gap)
    if view.gap > _IN_HOLES * c.setup.pin_reach:
        off_yaw, off_lateral = abs(view.yaw - c.aim.yaw), abs(view.lateral - c.aim.lateral)
        if off_lateral > tuning.capture_share * c.setup.mouth or off_yaw > math.radians(tuning.capture_deg):
            if c.was_in_holes:
                c.slid()
            elif pressed:
                c.jammed(view.yaw > 0.0)
            return Transition.back_out(f"too far off the axis at {view}", FailureReason.OFF_AXIS)
    # On a slippery floor wheels push the target along for as long as they spin.
    if closed and agrees and not c.presses:
        return STILL
    turn = min(max(twist.w, -tuning.press_turn_radps), tuning.press_turn_radps)
    return Twist(c.press_mps, turn)


def _slowed(c: DockingContext, twist: Twist, gap: float) -> Twist:
    """Return a twist on the same arc: the target stays in the cone.

    At that twist the camera reads the tags, and the unit comes to the port no faster than it is to.
    """
    turn, speed, share = c.setup.readable_turn(gap), c.greatest_speed(gap), 1.0
    if abs(twist.w) > turn:
        share = turn / abs(twist.w)
    if twist.v > speed:
        share = min(share, speed / twist.v)
    if share == 1.0:
        return twist
    c.memory.slowed(share, c.dt)
    return Twist(share * twist.v, share * twist.w)


def _held_by_doubt(monitor: CollisionMonitorState | None) -> bool:
    """Return whether the monitor stops a unit for bodies that are far away as far as anybody knows."""
    if monitor is None or monitor.state is not MonitorState.STOP or monitor.clearance is None:
        return False
    return monitor.clearance > _FAR_M


def lock(c: DockingContext) -> Twist | Transition:
    """Close the lock, with the wheels at rest unless a seat switch opens then.

    With its wheels at rest a unit rolls back by the backlash of its drive on a slope, or turns a little where
    its pins are askew. It then presses on slowly while the lock closes, which may push its target on a
    slippery floor.
    """
    report, memory, tuning = c.observation.lock, c.memory, c.tuning
    if memory.switches.update(not c.observation.both_closed, c.now_ns) > tuning.debounce_s:
        if c.presses:
            return Transition.back_out("seat switches opened while the cam closed", FailureReason.NOT_LATCHED)
        c.slow_down()
        c.presses = True
        return Transition(Phase.DOCK, "a seat switch opened with the wheels at rest: pressing on from now")
    # A report from before the command to close does not count.
    closed = (
        report is not None and report.stamp_ns >= memory.since_ns and report.position is LockPosition.CLOSED
    )
    if closed:
        return Transition(Phase.VERIFY, f"cam closed after {memory.lasted(c.now_ns):.2f} s")
    longest = max(tuning.latch_s, c.setup.close_time_s + tuning.latch_margin_s)
    if memory.lasted(c.now_ns) > longest:
        return Transition.back_out(f"cam not closed in {longest:.1f} s", FailureReason.NOT_LATCHED)
    return Twist(c.press_mps, 0.0) if c.presses else STILL


def retreat(c: DockingContext) -> Twist | Transition:
    """Open the lock, look behind, back out; then try again, or end the docking step.

    The unit's own camera does not show where it backs out to. The unit waits for an overhead picture exposed
    after the decision to back out, so that its collision monitor knows of new obstacles behind it; after too
    long a wait it goes by what was known before.
    """
    memory, tuning, report, pose = c.memory, c.tuning, c.observation.lock, c.observation.pose
    is_open = report is None or lock_is_open(c)
    if c.undocking and not is_open and memory.lasted(c.now_ns) > tuning.unlatch_s:
        # To pull at a closed lock would drag along the units on its other side.
        return _after_retreat(c)
    opened = memory.opened.update(is_open or memory.lasted(c.now_ns) > tuning.unlatch_s, c.now_ns)
    looked_behind = memory.looked_behind.update(has_looked_behind(c), c.now_ns)
    free = min(opened, looked_behind)
    if free < 0.0:
        return STILL
    longest = c.spec.retreat_m / tuning.retreat.speed_mps + tuning.retreat_margin_s
    is_there = c.gap >= c.spec.retreat_m - tuning.arrived_m or free > longest
    if memory.arrived.update(is_there, c.now_ns) >= tuning.settle_s:
        return _after_retreat(c)
    if is_there:
        return STILL
    memory.backing = c.observation
    if pose is None:
        return Twist(-tuning.retreat.speed_mps, 0.0)
    return c.backing_out(pose, c.spec.retreat_m)


def rest(c: DockingContext) -> Twist | Transition:
    """Stand still: the docking step is over."""
    return STILL


def _after_retreat(c: DockingContext) -> Transition:
    """Begin the next attempt, or end the docking step."""
    stuck = not_undocked(c) if c.undocking else not_parted(c)
    if stuck is not None:
        after = "" if c.undocking else f" after: {c.belief.reason}"
        return Transition(Phase.FAILED, f"not released: {stuck}{after}", FailureReason.NOT_RELEASED)
    if c.undocking:
        return Transition(Phase.DONE, f"undocked, {c.gap:z.3f} m away")
    if c.approached:
        tries, what = c.attempt, counted(c.attempt, "attempt")
    else:
        c.searches += 1
        tries, what = c.searches, f"its search failed {counted(c.searches, 'time')}"
    if tries >= c.spec.attempts:
        reason = f"gave up after {what}: {c.belief.reason}"
        return Transition(Phase.FAILED, reason, c.belief.setback)
    if c.approached:
        c.attempt += 1
        if c.was_in_holes and (c.presses or c.belief.setback in _SLIPPED):
            c.slow_down()
        c.approached, c.searches, c.was_in_holes, c.came_turned = False, 0, False, 0.0
    search = f", search {c.searches + 1}" if c.searches else ""
    reason = f"attempt {c.attempt}{search} from {c.gap:z.3f} m: {c.belief.reason}"
    assembler = c.assembler if c.reassemble else None
    if assembler is None:
        return Transition(Phase.HAND_OVER, reason)
    c.reassemble = False
    c.last_gap = None  # the unit goes far away
    assembler.reset(c.belief.reason)
    return Transition(Phase.ASSEMBLE, reason)
