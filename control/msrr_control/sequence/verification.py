"""The phases of a unit whose lock has closed: it makes sure that it is docked, and keeps watching."""

from __future__ import annotations

import math

from msrr_control.sequence.context import STILL, DockingContext, Transition
from msrr_control.sequence.evidence import (
    Loosened,
    closed_early,
    has_looked_behind,
    loosened,
    off_seat,
    shortest_seen,
)
from msrr_scenes.messages import Belief, Conviction, FailureReason, Phase, Twist

#: Share of the pins' length: sight that would not show a gap of it tells little about a seat.
_HALF_OUT = 0.5

#: Share of the speed of a tug at which the wheels are at rest again: a drive may lag by half a second.
_AT_REST = 0.1

#: Share of the way of a tug that a drive may still turn forwards, from pressing, when the tug begins.
_PRESSED_ON = 0.1

#: Share of the way of a tug by which a unit is seen to move that is not held: backlash may take up half of
#: the way.
MOVED = 1.0 / 3.0


def verify(c: DockingContext) -> Twist | Transition:
    """Compare what is seen with the view of a seated unit; lock and switches have to agree as well.

    Sight that alone disagrees may be wrong itself, and sight that would not show pins half out of the holes
    tells little, as do switches that were closed away from the port, or too early: then a tug test decides.
    """
    check, tuning, view = c.spec.verify, c.tuning, c.view
    against = loosened(c)
    if against is not None:
        return Transition.back_out(against.reason, FailureReason.NOT_VERIFIED)
    closed = c.observation.both_closed
    if closed and not check.by_sight:
        return Transition(Phase.DONE, "seat switches and cam closed")
    if view is not None and check.by_sight:
        enough = c.memory.frames_in_a_row(view.last_seen_ns, off_seat(c, view) is None) >= tuning.frames
        if closed and enough:
            c.distrusts = c.distrusts or (check.tug_m > 0.0 and closed_early(c, view))
            short = shortest_seen(c, view)
            reason = f"locked, and seen seated at {view}; a gap of {1e3 * short:.1f} mm would have been seen"
            if c.distrusts:
                reason += "; the seat switches tell nothing"
            if check.tug_m > 0.0 and (c.distrusts or short > _HALF_OUT * c.setup.pin_reach):
                return _tug(c, reason)
            return Transition(Phase.DONE, reason)
    if c.memory.lasted(c.now_ns) > check.time_s:
        if view is not None and view.age > c.spec.lost_time_s:
            view = None  # the pose goes on from the wheels alone
        seen = "not seen" if view is None else f"seen at {view}"
        off = None if view is None else off_seat(c, view)
        if off is not None and closed:
            seen += f": {off}"
            if check.tug_m:
                return _tug(c, f"locked, but {seen}")
            seen += ". The seat is false, or camera or marker are off by more than their tolerances"
        elif view is not None and closed:
            seen += _in_too_few_frames(c)
        return Transition.back_out(f"locked, but {seen}", FailureReason.NOT_VERIFIED)
    return STILL


def _tug(c: DockingContext, reason: str) -> Transition | Twist:
    """Begin a tug test once the drive, which has pressed, has come to rest."""
    limits, speed = c.setup.limits, c.spec.press_mps
    lag_m = speed / limits.kappa_per_s
    turns_on_s = speed / limits.a_max_mps2 + c.setup.link_latency_s
    turns_on_s += max(math.log(lag_m / (_PRESSED_ON * c.spec.verify.tug_m)), 0.0) / limits.kappa_per_s
    return Transition(Phase.TUG_TEST, reason) if c.memory.lasted(c.now_ns) >= turns_on_s else STILL


def tug_test(c: DockingContext) -> Twist | Transition:
    """Drive backwards with the lock closed, then compare what is seen with what was seen before.

    Whatever error of camera, marker or map let a seated unit be seen off its seat is in both views alike, so
    that only a unit that is not held is seen to move. For all that it knows, its switches have closed before
    the lock had the pins in reach: in the next attempt it presses until it gets on no more.
    """
    check, tuning, memory, view = c.spec.verify, c.tuning, c.memory, c.view
    against = loosened(c)
    if against is not None or view is None:
        c.distrusts = c.distrusts or against is not None
        seen = "the target is not seen" if against is None else against.reason
        return Transition.back_out(f"{seen} in a tug test", FailureReason.NOT_VERIFIED)
    if memory.looked_behind.update(has_looked_behind(c), c.now_ns) < 0.0:
        return STILL  # what stands behind has not been looked for since the unit came near the port
    if memory.before is None:
        memory.before = view
    passed, twist, limits = c.observation.passed, c.observation.twist, c.setup.limits
    # As fast as the drive can be on this way, so that the way that it is commanded is the way that it turns.
    speed = min(c.spec.press_mps, limits.v_close_mps, math.sqrt(limits.a_max_mps2 * check.tug_m))
    # A slow drive makes the larger part of that way after the command, and so does one on a slow link.
    rest_s = max(tuning.settle_s, -math.log(MOVED) / limits.kappa_per_s) + c.setup.link_latency_s
    most_s = check.tug_m / speed + rest_s + tuning.retreat_margin_s + check.time_s
    late = memory.lasted(c.now_ns) > most_s
    if memory.tugged < check.tug_m:
        if late:
            reason = f"locked, but there was no room for a tug test{c.observation.held}"
            return Transition.back_out(reason, FailureReason.NOT_VERIFIED)
        memory.tugged += c.dt * (speed if passed is None else -passed.v)
        return Twist(-speed, 0.0)
    rested_s = memory.arrived.update(abs(twist.v) < _AT_REST * speed, c.now_ns)
    moved = view.gap - memory.before.gap
    held = rested_s - view.age > rest_s and moved < MOVED * check.tug_m
    if memory.frames_in_a_row(view.last_seen_ns, held) >= tuning.frames:
        c.seat = view
        return Transition(Phase.DONE, f"locked, and held in a tug test; seen at {view}")
    if late or rested_s > rest_s + check.time_s:
        reason = f"locked, but seen to move by {1e3 * moved:.1f} mm in a tug test"
        if moved < MOVED * check.tug_m:
            reason = f"locked, but seen{_in_too_few_frames(c)} after a tug"
        else:
            c.distrusts = True
        return Transition.back_out(reason, FailureReason.NOT_VERIFIED)
    return STILL


def _in_too_few_frames(c: DockingContext) -> str:
    """Return in words in how many frames a seat was seen, and the key that gives a unit time for more."""
    frames, needed = c.memory.frames, c.tuning.frames
    time_s = c.spec.verify.time_s
    return (
        f" in {frames} of the {needed} frames for which docking.verify.time_s = {time_s:g} has to be enough"
    )


def done(c: DockingContext) -> Twist | Transition:
    """Stand still, and believe that the unit is docked for as long as lock, switches and sight agree.

    A belief that is lost does not come back by itself. The lock is still commanded to be closed: to open it
    would end a hold that may be good.
    """
    if c.belief.conviction is not Conviction.DOCKED:
        return STILL
    against, view = loosened(c), c.view
    if against is None and view is not None and c.spec.verify.by_sight:
        off = off_seat(c, view) is not None
        if c.memory.frames_in_a_row(view.last_seen_ns, off) >= c.tuning.frames:
            against = Loosened(FailureReason.UNSEATED, f"seen off its seat at {view}")
    if against is not None:
        reason = f"no longer docked: {against.reason}"
        c.belief = Belief(Conviction.UNDECIDED, against.failure, reason)
    return STILL
