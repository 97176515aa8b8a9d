"""The hand-over, in which a unit looks for its port and comes near enough to be certain where it is."""

from __future__ import annotations

import math

from msrr_control.sequence.context import DockingContext, Transition
from msrr_control.sequence.evidence import with_doubt
from msrr_control.sequence.port_view import PortView
from msrr_control.sequence.search import scan, turn_rate
from msrr_scenes.messages import FailureReason, Phase, Twist, seconds

#: Failed searches after which a search still begins nearer than the one before it. The long-distance phase
#: ends 0.7 m in front of the port, and tags are as large as they get within view at 0.45 m.
_NEARER_UP_TO = 2


def _what_was_read(c: DockingContext, unseen: float) -> str:
    """Return in words what the onboard camera read during a search that gave no pose."""
    read_ns = c.observation.tags_read_ns
    if read_ns is None or seconds(c.now_ns - read_ns) > unseen:
        return "no marker seen"
    return "no pose agrees with the tags that were read (turned, or of another size or place?)"


def hand_over(c: DockingContext) -> Twist | Transition:
    """Wait for a certain estimate and a target inside the cone; search for a target that is not seen."""
    view, memory, tuning = c.view, c.memory, c.tuning
    max_w = min(c.setup.limits.w_max_radps, c.setup.readable_turn(c.gap))
    unseen = memory.unseen.update(view is None or view.age > c.spec.lost_time_s, c.now_ns)
    if view is None or unseen >= 0.0:
        middle = view.bearing if view is not None else -c.turned
        if unseen > tuning.search.wait_s and _may_creep_unseen(c, view):
            memory.crept_s += c.dt
            return Twist(tuning.search.creep_mps, turn_rate(middle, tuning.search, max_w))
        unseen -= memory.crept_s
        if unseen > c.spec.search_time_s:
            if c.ever_seen:
                return Transition.back_out(
                    f"target not found in {unseen:.1f} s", FailureReason.TARGET_LOST, reassemble=True
                )
            reason = f"{_what_was_read(c, unseen)} in {unseen:.1f} s"
            if c.assembler is None:
                return Transition(Phase.FAILED, reason, FailureReason.NEVER_DETECTED)
            return Transition.back_out(reason, FailureReason.NEVER_DETECTED, reassemble=True)
        heading, rate = scan(unseen, c.spec.search_time_s, tuning.search, max_w)
        return Twist(0.0, turn_rate(middle + heading, tuning.search, max_w, rate))
    c.turned = memory.crept_s = 0.0
    in_cone = view.widest_edge < c.setup.los.outer
    ready_sigma_yaw = math.radians(tuning.ready_sigma_deg)
    certain = view.sigma_lateral <= tuning.ready_sigma_m and view.sigma_yaw <= ready_sigma_yaw
    if in_cone and certain:
        to = Phase.CALIBRATE if c.calibrate else Phase.DOCK
        return Transition(to, f"target seen at {view}")
    if memory.seen_s > tuning.ready_time_s:
        obstacle = "uncertain" if in_cone else "outside the cone"
        return Transition.back_out(
            f"target seen but {obstacle} at {view}", FailureReason.UNREADY, reassemble=True
        )
    creeps = in_cone and _has_room(c, view)
    if not creeps:  # nearer to the port the tags are larger, and more of them are read
        memory.seen_s += c.dt
    creep = tuning.search.creep_mps if creeps else 0.0
    return Twist(creep, turn_rate(view.bearing, tuning.search, max_w))


def _may_creep_unseen(c: DockingContext, view: PortView | None) -> bool:
    """Return whether the unit comes nearer to a target that it has just lost, or did not find before.

    One or two readings of a small tag leave so much doubt about the way to the port that it may be near. The
    next searches come nearer all the same if the long-distance phase has brought the unit in front of the
    port for them: then the overhead camera knows the way.
    """
    search = c.tuning.search
    if c.memory.crept_s * search.creep_mps >= search.unseen_m:
        return False
    if view is not None and _has_room(c, view):
        return True
    return c.assembler is not None and 0 < c.searches <= _NEARER_UP_TO


def _has_room(c: DockingContext, view: PortView) -> bool:
    return view.gap > with_doubt(c.tuning.search.creep_gap_m, view.sigma_gap)
