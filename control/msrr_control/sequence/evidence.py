"""The evidence by which a unit believes that it is docked, undocked, or clear of the port."""

from __future__ import annotations

import math
from typing import NamedTuple

from msrr_control.sequence.context import DockingContext
from msrr_control.sequence.port_view import PortView
from msrr_scenes.messages import FailureReason, LockPosition, MonitorState

#: Standard deviations of an estimate that are granted before a seated unit is taken for one that is not: of
#: 1000 estimates of one figure three are farther off.
_SIGMAS = 3.0


#: How much farther a unit may be seen beyond its seat than short of it.
_DEEPER = 2.0


class Loosened(NamedTuple):
    """What speaks against a unit being locked in its seat: which failure that is, and the reason in words."""

    failure: FailureReason
    reason: str


def loosened(c: DockingContext) -> Loosened | None:
    """Return what lock or switches say against a locked and seated unit; None if nothing."""
    report = c.observation.lock
    # Open for no longer than they bounce, the switches say nothing.
    opened = c.memory.switches.update(not c.observation.both_closed, c.now_ns)
    if report is None or report.position is not LockPosition.CLOSED:
        says = "nothing" if report is None else report.position.value
        return Loosened(FailureReason.LOCK_OPENED, f"the lock reports {says}")
    if opened > c.tuning.debounce_s:
        return Loosened(FailureReason.UNSEATED, f"a seat switch has been open for {opened:.2f} s")
    return None


def off_seat(c: DockingContext, view: PortView) -> str | None:
    """Return in words by what a view is not that of a seated unit; None if it is, as far as it is certain."""
    check, degrees = c.spec.verify, math.degrees(1.0)
    gap, side = (with_doubt(check.position_m, sigma) for sigma in (view.sigma_gap, view.sigma_lateral))
    heading = with_doubt(math.radians(check.yaw_deg), view.sigma_yaw)
    seat = (c.tuning.seated_gap_m, 0.0, 0.0) if c.seat is None else c.seat[:3]
    figures = (
        ("gap", view.gap - seat[0], gap, 1e3, "mm"),
        ("side", view.lateral - seat[1], side, 1e3, "mm"),
        ("heading", view.yaw - seat[2], heading, degrees, "deg"),
    )
    too_far = [
        f"{name} off by {scale * abs(off):.1f} {unit}, {scale * limit:.1f} {unit} accepted"
        for name, off, limit, scale, unit in figures
        if not (in_seat_range(off, limit) if name == "gap" else abs(off) <= limit)
    ]
    return "; ".join(too_far) or None


def in_seat_range(off: float, limit: float) -> bool:
    """Return whether a gap that is seen ``off`` that of a seated unit [m] may be one of a seated unit.

    No unit is deeper in the port than its seat. What looks so is an error of the estimate, and no sign that
    the unit is not seated; only far beyond the limit nothing that is seen can be trusted.
    """
    return -_DEEPER * limit <= off <= limit


def with_doubt(accepted: float, sigma: float) -> float:
    """Return the largest deviation that may be one of ``accepted``, seen with an error of ``sigma``.

    What seated units deviate by and what sight is off by are independent, so that their squares add up.
    """
    return math.hypot(accepted, _SIGMAS * sigma)


def shortest_seen(c: DockingContext, view: PortView) -> float:
    """Return the gap [m] of a dock that fell short and that sight would have shown 39 times of 40."""
    return with_doubt(c.spec.verify.position_m, view.sigma_gap) + 2.0 * view.sigma_gap


def closed_early(c: DockingContext, view: PortView) -> bool:
    """Return whether a pin went on, after its seat switch had closed, by more than the switch travels.

    Then the switches do not show a seat, and the pins may be out of reach of the lock. Errors of camera,
    marker and map are the same in both views. A unit that comes in turned has one pin at the bottom long
    before the other, and goes on to turn about it: the gap between the faces would show little of that way.
    """
    most = c.tuning.switch_travel_m + c.tuning.progress_m
    return any(
        closed is not None and closed - view.gap_at(aside) > most
        for closed, aside in zip(c.closed_gaps, c.setup.pins, strict=True)
    )


def lock_is_open(c: DockingContext) -> bool:
    """Return whether the lock has reported that it is open."""
    report = c.observation.lock
    return report is not None and report.position is LockPosition.OPEN


def not_parted(c: DockingContext) -> str | None:
    """Return what speaks against the unit having left the port, in words; None if nothing.

    A target that is seen shows the gap. The wheels alone may have slipped: without sight their way counts
    only while the lock reports open. A unit that the collision monitor held has not been stopped by its port,
    nor has one whose pins are farther to a side than the mouths of the holes are wide.
    """
    backing, report = c.memory.backing, c.observation.lock
    monitor = None if backing is None else backing.monitor
    if monitor is not None and monitor.state is MonitorState.STOP:
        return None
    in_port = c.gap < c.setup.pin_reach + c.tuning.retreat.clear_m
    if c.view is not None and abs(c.view.lateral) > with_doubt(c.setup.mouth, c.view.sigma_lateral):
        in_port = False
    if c.view is not None and c.view.age <= c.spec.lost_time_s:
        return f"stuck, seen at {c.view}" if in_port else None
    if report is not None and report.position is not LockPosition.OPEN:
        return f"stuck, not seen, and the lock reports {report.position.value}"
    return f"stuck, {1e3 * c.gap:z.0f} mm away by odometry" if in_port else None


def not_undocked(c: DockingContext) -> str | None:
    """Return what speaks against the unit being undocked, in words; None if nothing."""
    if not lock_is_open(c):
        report = c.observation.lock
        says = "nothing" if report is None else report.position.value
        return f"the lock reports {says}, {c.gap:z.3f} m away"
    if c.observation.both_closed:
        return f"both seat switches are closed, {c.gap:z.3f} m away"
    if c.gap < c.spec.retreat_m - c.tuning.arrived_m:
        held = "" if c.memory.backing is None else c.memory.backing.held
        return f"the retreat ended {c.gap:z.3f} m away, {c.spec.retreat_m:.3f} m were to be backed out{held}"
    return None


def has_looked_behind(c: DockingContext) -> bool:
    """Return whether an overhead picture of this stay has arrived, or is no longer waited for."""
    if c.assembler is None or c.memory.lasted(c.now_ns) > c.tuning.look_around_s:
        return True
    exposed_ns = c.observation.overhead_exposed_ns
    return exposed_ns is not None and exposed_ns > c.memory.since_ns
