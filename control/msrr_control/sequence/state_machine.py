"""The phase machine of one docking step, from the first look to the verified lock.

::

    ASSEMBLE -> HAND_OVER -> DOCK -> LOCK -> VERIFY -> DONE
     ^  |         ^   |       |       |        |
     |  |         |   +-------+-------+--------+--> RETREAT -> FAILED   (no attempt left)
     |  |         +-----------------------------------+   (next attempt)
     |  +--> FAILED  (no way, or not localised)       |
     +------------------------------------------------+   (next attempt, the hand-over itself having failed)

What the unit does in each phase in front of the port is in :mod:`msrr_control.sequence.states`; here is which
one comes, and what the unit says of it. It decides by estimates and its own sensors alone. Without a
long-distance phase (the unit starts in front of the port) every attempt begins at the hand-over.
"""

from __future__ import annotations

import math

from msrr_control.docking.controller import Controller
from msrr_control.docking.law import DockSetup
from msrr_control.sequence.memory import StateMemory, Transition
from msrr_control.sequence.observation import Assembler, GiveUp, Observation
from msrr_control.sequence.port_view import PortView
from msrr_control.sequence.states import STILL, DockingPhases
from msrr_control.sequence.tuning import PhaseTuning
from msrr_scenes.errors import MsrrError
from msrr_scenes.messages import Action, Belief, Conviction, Phase, Twist
from msrr_scenes.specs.plan import DockingSpec

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
        self._assembler = assembler
        tuning = tuning if tuning is not None else PhaseTuning()
        self._docking = DockingPhases(spec, setup, controller, tuning, comes_from_afar=assembler is not None)
        self._phases = {
            Phase.ASSEMBLE: self._assemble,
            Phase.HAND_OVER: self._docking.hand_over,
            Phase.DOCK: self._docking.dock,
            Phase.LOCK: self._docking.lock,
            Phase.VERIFY: self._docking.verify,
            Phase.RETREAT: self._retreat,
            Phase.DONE: self._rest,
            Phase.FAILED: self._rest,
        }
        self._phase, self._reason, self._attempt = Phase.ASSEMBLE, "start", 1
        self._visit: StateMemory | None = None
        self._undocking = False
        self._reassemble = False  # the hand-over failed: the next attempt begins with the long-distance phase

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

    def step(self, senses: Observation) -> Action:
        """Decide at one control instant.

        Args:
            senses: What is known now; time does not run backwards.

        Returns:
            Phase, lock and command; the twist is within the drive's limits, those of the close range once
            the long-distance phase is over.

        Raises:
            MsrrError: The controller returned something that is no number.
        """
        view = self._docking.look(senses)
        twist = STILL
        for _ in Phase:  # a phase that has nothing to do is passed in the same instant; none comes twice
            if self._visit is None:
                self._visit = StateMemory(senses.now_ns)
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

    # The phases that begin and end a docking step.

    def _assemble(self, senses: Observation, view: PortView | None, visit: StateMemory) -> Twist | Transition:
        """Bring the unit in front of the port; passed at once if it starts there."""
        if self._assembler is None:
            return Transition(Phase.HAND_OVER, "starts in front of the port")
        decision = self._assembler.step(senses)
        if decision is None:
            return Transition(Phase.HAND_OVER, "assembled in front of the port")
        if isinstance(decision, GiveUp):
            return Transition(Phase.FAILED, decision.reason, decision.setback)
        return decision

    def _retreat(self, senses: Observation, view: PortView | None, visit: StateMemory) -> Twist | Transition:
        """Open the lock, back out, and try again or give up."""
        twist = self._docking.back_out(senses, visit)
        return twist if twist is not None else self._after_retreat(self._docking.gap)

    def _rest(self, senses: Observation, view: PortView | None, visit: StateMemory) -> Twist | Transition:
        return STILL

    # What they share.

    def _after_retreat(self, gap: float) -> Transition:
        if self._undocking:
            return Transition(Phase.DONE, f"undocked, {gap:.3f} m away")
        if self._attempt < self._spec.attempts:
            self._attempt += 1
            again = f"attempt {self._attempt} from {gap:.3f} m: {self.belief.reason}"
            if self._reassemble and self._assembler is not None:
                self._reassemble = False
                self._docking.forget_gap()
                self._assembler.reset(self.belief.reason)
                return Transition(Phase.ASSEMBLE, again)
            return Transition(Phase.HAND_OVER, again)
        return Transition(
            Phase.FAILED, f"gave up after {self._attempt} attempts: {self.belief.reason}", self.belief.setback
        )

    def _change(self, move: Transition) -> None:
        """Take up another phase and say what that means."""
        self._phase, self._reason, self._visit = move.to, move.reason, None
        self._reassemble = self._reassemble or move.reassemble
        if move.to is Phase.DONE:
            said = Conviction.UNDOCKED if self._undocking else Conviction.DOCKED
            self.belief = Belief(said, None, move.reason)
        elif move.to is Phase.FAILED:
            self.belief = Belief(Conviction.GAVE_UP, move.setback, move.reason)
        elif move.setback is not None:
            self.belief = Belief(Conviction.UNDECIDED, move.setback, move.reason)

    def _enter(self, senses: Observation) -> None:
        if self._phase is Phase.DOCK:
            self._docking.begin_approach(senses)

    def _limited(self, twist: Twist) -> Twist:
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            raise MsrrError(f"a law commanded {twist} in phase {self._phase.value}")
        limits = self._setup.limits
        v = limits.v_max_mps if self._phase is Phase.ASSEMBLE else limits.v_close_mps
        w = limits.w_max_radps
        return Twist(min(max(float(twist.v), -v), v), min(max(float(twist.w), -w), w))
