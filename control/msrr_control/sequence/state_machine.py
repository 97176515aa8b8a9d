"""The state machine of one docking step, from the first look at the target to the verified lock.

It decides by estimates and the unit's own sensors alone. Without a long-distance phase (the unit starts in
front of the port) every attempt begins at the hand-over, and a target that is never seen there ends the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from msrr_control.docking.controller import Controller
from msrr_control.docking.law import DockSetup
from msrr_control.kinematics.elementwise import limit
from msrr_control.sequence import states, verification
from msrr_control.sequence.approach import begin_approach, dock
from msrr_control.sequence.context import STILL, DockingContext, Transition
from msrr_control.sequence.hand_over import hand_over
from msrr_control.sequence.observation import Assembler, Observation
from msrr_control.sequence.state_memory import StateMemory
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.errors import MsrrError, ProgramFailedError
from msrr_scenes.messages import Action, Belief, Conviction, Phase, Twist
from msrr_scenes.specs.control import DockingSpec


class State(NamedTuple):
    """A row of the table of states.

    Attributes:
        act: What the unit does: it returns a twist to stay, or a transition.
        leads_to: Phases that may come next.
        holds_lock: Whether the lock is commanded to be closed.
        enter: Called when the phase is entered.
    """

    act: Callable[[DockingContext], Twist | Transition]
    leads_to: tuple[Phase, ...]
    holds_lock: bool = False
    enter: Callable[[DockingContext], None] | None = None


#: What the unit does in each phase and what may come next, in the order of a docking without failures. A
#: failure leads to a retreat, from there to the next attempt at the hand-over. If the hand-over itself has
#: failed, it leads to the next search of the same attempt, with the long-distance phase first, as it does if
#: the collision monitor has held the approach. Where neither could do better it is final: the long-distance
#: phase has given up, or there is none and the target was never seen. Undocking leads from DONE to RETREAT
#: and back.
STATES = {
    Phase.ASSEMBLE: State(states.assemble, leads_to=(Phase.HAND_OVER, Phase.FAILED)),
    Phase.HAND_OVER: State(hand_over, leads_to=(Phase.CALIBRATE, Phase.DOCK, Phase.RETREAT, Phase.FAILED)),
    Phase.CALIBRATE: State(states.calibrate, leads_to=(Phase.HAND_OVER,), enter=begin_approach),
    Phase.DOCK: State(dock, leads_to=(Phase.LOCK, Phase.RETREAT), enter=begin_approach),
    Phase.LOCK: State(states.lock, leads_to=(Phase.VERIFY, Phase.DOCK, Phase.RETREAT), holds_lock=True),
    Phase.VERIFY: State(
        verification.verify, leads_to=(Phase.DONE, Phase.TUG_TEST, Phase.RETREAT), holds_lock=True
    ),
    Phase.TUG_TEST: State(verification.tug_test, leads_to=(Phase.DONE, Phase.RETREAT), holds_lock=True),
    Phase.DONE: State(verification.done, leads_to=(), holds_lock=True),
    Phase.RETREAT: State(
        states.retreat, leads_to=(Phase.HAND_OVER, Phase.ASSEMBLE, Phase.DONE, Phase.FAILED)
    ),
    Phase.FAILED: State(states.rest, leads_to=()),
}


class PhaseMachine:
    """Decides what the docking unit does at every control instant."""

    def __init__(
        self,
        spec: DockingSpec,
        setup: DockSetup,
        controller: Controller,
        assembler: Assembler | None = None,
        tuning: PhaseTuning | None = None,
        docked: bool = False,
        calibrate: bool = False,
    ) -> None:
        """Begin before the first attempt.

        Without an assembler the unit starts in front of the port. ``docked`` is whether it is docked already,
        and is to undock; ``calibrate`` whether it calibrates camera and wheels in front of the port before it
        docks.
        """
        tuning = tuning if tuning is not None else PhaseTuning()
        self._context = DockingContext(spec, setup, controller, assembler, tuning, 1.0 / setup.rate_hz)
        self._context.calibrate = calibrate
        if docked:
            self._context.last_gap = 0.0
        self._phase, self._reason = (Phase.DONE if docked else Phase.ASSEMBLE), "start"
        self._entered = False

    @property
    def belief(self) -> Belief:
        """What the unit says about this docking step so far."""
        return self._context.belief

    @property
    def phase(self) -> Phase:
        """The phase in which the last step ended."""
        return self._phase

    @property
    def clear_gap(self) -> float | None:
        """Last known distance between the faces [m]; None while the unit may press against the port."""
        c = self._context
        near_m = c.setup.pin_reach + 2.0 * c.tuning.retreat.clear_m
        return None if c.last_gap is None or c.last_gap < near_m else c.last_gap

    @property
    def attempt(self) -> int:
        """The attempt under way, counted from 1."""
        return self._context.attempt

    @property
    def finished(self) -> bool:
        """Whether the docking step is over: done or failed."""
        return self._phase in (Phase.DONE, Phase.FAILED)

    def undock(self, retreat_m: float | None = None) -> None:
        """Open the lock and back out, from the next step on.

        It stops where the faces are ``retreat_m`` apart, or as far as after a retreat.

        Raises:
            MsrrError: The unit has not docked, or it has undocked already.
        """
        # A unit whose belief was lost while it was docked may still hang in its lock.
        if self._phase is not Phase.DONE or self._context.undocking:
            raise MsrrError(f"cannot undock in phase {self._phase.text!r}: the unit is not docked")
        if retreat_m is not None:
            self._context.spec = self._context.spec.model_copy(update={"retreat_m": retreat_m})
        self._context.belief, self._context.undocking = Belief(), True
        self._phase, self._reason, self._entered = Phase.RETREAT, "undock", False

    def step(self, observation: Observation) -> Action:
        """Decide at one control instant; time does not run backwards.

        Returns:
            Phase, lock and command; the twist is within the drive's limits, those of the close range once
            the long-distance phase is over.

        Raises:
            ProgramFailedError: The controller returned a command that is not finite.
        """
        context = self._context
        context.observe(observation)
        twist = STILL
        for _ in STATES:  # a phase with nothing to do is passed in the same instant; none comes twice
            state = STATES[self._phase]
            if not self._entered:
                self._entered, context.memory = True, StateMemory(observation.now_ns)
                if state.enter is not None:
                    state.enter(context)
            decision = state.act(context)
            if isinstance(decision, Twist):
                twist = decision
                break
            was_retreat = self._phase is Phase.RETREAT
            self._change(decision)
            if was_retreat:  # the phase after a retreat, and its reason, are visible for one instant
                break
        return Action(
            stamp_ns=observation.now_ns,
            phase=self._phase,
            attempt=context.attempt,
            twist=self._limited(twist),
            lock=STATES[self._phase].holds_lock and not context.undocking,
            reason=self._reason_now(),
        )

    def _reason_now(self) -> str:
        """Return why the phase was entered; in the long-distance phase why the unit does what it does."""
        assembler = self._context.assembler
        progress = None if assembler is None else assembler.progress
        if self._phase is not Phase.ASSEMBLE or not self._entered or progress is None:
            return self._reason
        return f"{progress.stage}: {progress.reason}{self._context.observation.held}"

    def _change(self, transition: Transition) -> None:
        """Change to another phase and update the belief."""
        context, to = self._context, transition.to
        if to not in STATES[self._phase].leads_to:
            raise RuntimeError(f"there is no transition from {self._phase} to {to}")
        self._phase, self._reason, self._entered = to, transition.reason, False
        context.reassemble = context.reassemble or transition.reassemble
        if to is Phase.DONE:
            conviction = Conviction.UNDOCKED if context.undocking else Conviction.DOCKED
            context.belief = Belief(conviction, None, transition.reason)
        elif to is Phase.FAILED:
            context.belief = Belief(Conviction.GAVE_UP, transition.failure, transition.reason)
        elif transition.failure is not None:
            context.belief = Belief(Conviction.UNDECIDED, transition.failure, transition.reason)

    def _limited(self, twist: Twist) -> Twist:
        """Return a twist within the limits of the drive in this phase."""
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            raise ProgramFailedError(f"a law commanded {twist} in phase {self._phase.text}")
        limits = self._context.setup.limits
        v = limits.v_max_mps if self._phase is Phase.ASSEMBLE else limits.v_close_mps
        w = limits.w_max_radps
        return Twist(limit(float(twist.v), -v, v), limit(float(twist.w), -w, w))
