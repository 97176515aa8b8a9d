"""What the docking unit does far from the port, to calibrate, to lock, and to back out.

Each function stands for one phase: it returns a twist to stay in the phase, or a :class:`Transition` to
another. :mod:`msrr_control.sequence.state_machine` has the table of all phases.
"""

from __future__ import annotations

from msrr_control.sequence.calibration_drive import calibration_twist
from msrr_control.sequence.context import STILL, DockingContext, Transition
from msrr_control.sequence.evidence import has_looked_behind, lock_is_open, not_parted, not_undocked
from msrr_control.sequence.observation import GiveUp
from msrr_scenes.messages import FailureReason, LockPosition, Phase, Twist
from msrr_scenes.wording import counted

#: Failures of a unit that is no longer in its seat, or in the holes. On a floor that holds its wheels it
#: would most likely have stayed there.
_SLIPPED = {FailureReason.OFF_AXIS, FailureReason.NOT_VERIFIED}


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


def calibrate(c: DockingContext) -> Twist | Transition:
    """Drive in front of the port until the estimator knows camera and wheels better, then begin anew.

    Turned away, the unit may see the target no longer; it then turns on by its wheels.
    """
    twist = calibration_twist(c, c.tuning.calibration)
    if twist is not None:
        return twist
    c.calibrate = False
    return Transition(Phase.HAND_OVER, f"drove for {c.memory.lasted(c.now_ns):.1f} s to calibrate")


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
    closed = report is not None and report.position is LockPosition.CLOSED
    anew = report is not None and report.stamp_ns >= memory.since_ns
    if closed and anew:
        return Transition(Phase.VERIFY, f"cam closed after {memory.lasted(c.now_ns):.2f} s")
    longest = max(tuning.latch_s, c.setup.close_time_s + tuning.latch_margin_s) + c.setup.lock_delay_s
    if memory.lasted(c.now_ns) > longest:
        reason = "cam closed before the command to close, and has not opened since"
        return Transition.back_out(
            reason if closed else f"cam not closed in {longest:.1f} s", FailureReason.NOT_LATCHED
        )
    return Twist(c.press_mps, 0.0) if c.presses else STILL


def retreat(c: DockingContext) -> Twist | Transition:
    """Open the lock, look behind, back out; then try again, or end the docking step.

    The unit's own camera does not show where it backs out to. The unit waits for an overhead picture exposed
    after the decision to back out, so that its collision monitor knows of new obstacles behind it; after too
    long a wait it goes by what was known before.
    """
    memory, tuning, report, pose = c.memory, c.tuning, c.observation.lock, c.observation.pose
    is_open = report is None or lock_is_open(c)
    stays_closed = not is_open and memory.lasted(c.now_ns) > tuning.unlatch_s + c.setup.lock_delay_s
    if c.undocking and stays_closed:
        # To pull at a closed lock would drag along the units on its other side.
        return _after_retreat(c)
    opened = memory.opened.update(is_open or stays_closed, c.now_ns)
    looked_behind = memory.looked_behind.update(has_looked_behind(c), c.now_ns)
    free = min(opened, looked_behind)
    if free < 0.0:
        return STILL
    speed = min(tuning.retreat.speed_mps, c.setup.limits.v_close_mps)
    longest = c.spec.retreat_m / speed + speed / c.setup.limits.a_max_mps2 + tuning.retreat_margin_s
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
