"""What the docking unit does on its way to the port and in it, until its pins are at the bottom."""

from __future__ import annotations

import math

from msrr_control.docking.controller import promised_speed
from msrr_control.kinematics.elementwise import limit
from msrr_control.sequence.context import STILL, DockingContext, Transition
from msrr_control.sequence.evidence import in_seat_range, with_doubt
from msrr_control.sequence.port_view import PortView
from msrr_scenes.messages import CollisionMonitorState, FailureReason, MonitorState, Phase, Twist

#: Share of the pins' length: at a smaller gap the pins are in the holes, and where the unit is to the side is
#: no matter of sight, which goes wrong there with wheels that spin while the unit stands.
_IN_HOLES = 0.5

#: Clearance beyond which a body stops no unit that knows where it is [m]: units stop within a tenth of that,
#: and no place is as uncertain that somebody has seen in the last seconds.
_FAR_M = 0.3


def begin_approach(c: DockingContext) -> None:
    """Let the controller begin an approach from here."""
    c.approached = True
    if c.observation.pose is not None:
        c.controller.reset(c.control_inputs(c.observation.pose))


def dock(c: DockingContext) -> Twist | Transition:
    """Follow the controller to the port, then press until the pins are at the bottom of the holes."""
    view, pose = c.view, c.observation.pose
    if view is None or pose is None or view.age > c.spec.lost_time_s:
        return Transition.back_out(f"target lost for {c.spec.lost_time_s:.2f} s", FailureReason.TARGET_LOST)
    _take_in_sensors(c, view)
    end = _seated(c, view) or _doubted(c, view) or _slid(c, view) or _stalled(c, view)
    if end is not None:
        return end
    twist = c.controller.step(c.control_inputs(pose))
    if not _at_port(c, view):
        return _slowed(c, twist, view.gap)
    return _off_axis(c, view) or _pressing(c, view, twist)


def _contact_gap(c: DockingContext) -> float:
    """Return the gap at which pressing replaces the controller [m]."""
    return c.setup.pin_reach + c.tuning.contact_m


def _at_port(c: DockingContext, view: PortView) -> bool:
    return view.gap <= _contact_gap(c)


def _tugs(c: DockingContext) -> bool:
    """Return whether a tug test follows, which tells what sight or switches are wrong about."""
    return c.spec.verify.by_sight and c.spec.verify.tug_m > 0.0


def _take_in_sensors(c: DockingContext, view: PortView) -> None:
    """Take in what seat switches and estimate tell at this instant."""
    switches, closed = c.observation.switches, c.observation.both_closed
    if closed and _tugs(c) and view.gap > with_doubt(_contact_gap(c), view.sigma_gap):
        c.distrusts = True
    if switches is None or not switches.either:
        c.closed_gaps = None, None
    else:
        if not c.was_in_holes:
            c.reached_bottom(switches.left, switches.right)
        left, right = (
            (view.gap_at(aside) if before is None else before) if there else None
            for there, before, aside in zip(
                (switches.left, switches.right), c.closed_gaps, c.setup.pins, strict=True
            )
        )
        c.closed_gaps = left, right
    if not _at_port(c, view):
        c.memory.sigma_lateral = min(c.memory.sigma_lateral or math.inf, view.sigma_lateral)
        c.memory.sigma_yaw = min(c.memory.sigma_yaw or math.inf, view.sigma_yaw)


def _agrees(c: DockingContext, view: PortView) -> bool:
    """Return whether sight agrees with closed switches; if not, the unit presses while it gets on."""
    near = with_doubt(c.tuning.near_m, view.sigma_gap)
    agrees = in_seat_range(view.gap - c.tuning.seated_gap_m, near) or not c.spec.verify.by_sight
    return agrees and not c.distrusts


def _seated(c: DockingContext, view: PortView) -> Transition | None:
    """Pass on with both seat switches closed."""
    seated = c.observation.both_closed and _at_port(c, view) and _agrees(c, view)
    if c.memory.switches.update(seated, c.now_ns) < c.tuning.debounce_s:
        return None
    return Transition(Phase.LOCK, f"both seat switches closed at {view}")


def _doubted(c: DockingContext, view: PortView) -> Transition | None:
    """Back out if nobody knows for too long where others are; until then nothing is expected of the unit."""
    monitor = c.observation.monitor
    doubted_s = c.memory.doubted.update(_held_by_doubt(monitor), c.now_ns)
    if doubted_s > c.tuning.doubt_s:
        reason = f"held for {doubted_s:.0f} s by the collision monitor: {monitor}, at {view}"
        return Transition.back_out(reason, FailureReason.STALLED, reassemble=True)
    if doubted_s >= 0.0:  # until somebody sees them again; another attempt would be held as well
        c.memory.pause(c.now_ns)
    return None


def _held_by_doubt(monitor: CollisionMonitorState | None) -> bool:
    """Return whether the monitor stops a unit for bodies that are far away as far as anybody knows."""
    if monitor is None or monitor.state is not MonitorState.STOP or monitor.clearance is None:
        return False
    return monitor.clearance > _FAR_M


def _slid(c: DockingContext, view: PortView) -> Transition | None:
    """Back out of a port that the unit slides out of: to press on turns it, towards what stands beside it."""
    memory, switches = c.memory, c.observation.switches
    parted = switches is not None and not switches.either and c.was_in_holes
    parted_s = memory.parted.update(parted and _at_port(c, view), c.now_ns)
    if parted_s <= 0.0:
        memory.parted_gap = view.gap
    if parted_s <= c.tuning.parted_s or view.gap < memory.parted_gap:
        return None
    c.slid()
    reason = f"both seat switches opened again as it pressed, at {view}"
    return Transition.back_out(reason, FailureReason.OFF_AXIS)


def _stalled(c: DockingContext, view: PortView) -> Transition | None:
    """Back out, or let a tug test tell, after too long a time without progress.

    If any progress counted, the unit could creep for minutes: it has to keep a share of the promised speed,
    or near the seat to halve what is left.
    """
    memory, tuning, monitor = c.memory, c.tuning, c.observation.monitor
    closed, switches, at_port = c.observation.both_closed, c.observation.switches, _at_port(c, view)
    way = tuning.progress_share * promised_speed(c.controller, c.setup.limits) * c.spec.stall_time_s
    idle = memory.without_progress(view.off_seat(tuning.seated_gap_m), tuning.progress_m, way, c.now_ns)
    limited_s = memory.limited.update(monitor is not None and monitor.limits, c.now_ns)
    if at_port:
        passed = c.observation.passed
        memory.pushed += c.dt * (c.press_mps if passed is None else passed.v)
    # Pins hold only a unit that the monitor let push on by more than what counts as progress.
    memory.pressed = at_port and memory.pushed > memory.next_progress(tuning.progress_m, way)
    if idle <= c.spec.stall_time_s:
        return None
    if closed and at_port and _tugs(c):
        # Sight may be what is wrong, and would be so in the next attempt as well; a tug test tells.
        away = "; they were closed away from the port, too" if c.distrusts else ""
        return Transition(Phase.LOCK, f"both seat switches closed, although seen at {view}{away}")
    # The first decision of the monitor comes with the next instant.
    held = limited_s >= idle - 2.0 * c.dt
    if held:  # the same approach would end here again; the long-distance phase knows what stands where
        reason = f"held for {idle:.1f} s by the collision monitor: {monitor}, at {view}"
    else:
        reason = f"no progress for {idle:.1f} s at {view}"
    if memory.pressed and not closed:
        # The pin that is farther in tells how the unit is turned: sight may be off by more than that.
        one_closed = switches is not None and switches.either
        c.jammed(switches.right if one_closed and switches is not None else view.yaw > 0.0)
    return Transition.back_out(reason, FailureReason.STALLED, reassemble=held)


def _off_axis(c: DockingContext, view: PortView) -> Transition | None:
    """Back out if the pins are too far off the axis to be centred, as far as sight tells before the holes."""
    if view.gap <= _IN_HOLES * c.setup.pin_reach:
        return None
    off_yaw, off_lateral = abs(view.yaw - c.aim.yaw), abs(view.lateral - c.aim.lateral)
    centred = off_lateral <= c.tuning.capture_share * c.setup.mouth
    if centred and off_yaw <= math.radians(c.tuning.capture_deg):
        return None
    if c.was_in_holes:
        c.slid()
    elif c.memory.pressed:
        c.jammed(view.yaw > 0.0)
    return Transition.back_out(f"too far off the axis at {view}", FailureReason.OFF_AXIS)


def _pressing(c: DockingContext, view: PortView, twist: Twist) -> Twist:
    """Return the twist with which the unit presses, turning as its controller does.

    It stands still in its seat: on a slippery floor wheels push the target along for as long as they spin.
    """
    if c.observation.both_closed and _agrees(c, view) and not c.presses:
        return STILL
    most = c.tuning.press_turn_radps
    return Twist(c.press_mps, limit(twist.w, -most, most))


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
