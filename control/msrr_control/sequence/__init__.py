"""The sequence of one docking step: the phase machine, and what it observes at every control instant."""

from msrr_control.sequence.observation import Assembler, GiveUp, Observation
from msrr_control.sequence.state_machine import PhaseMachine
from msrr_control.sequence.tuning import PhaseTuning

__all__ = ["Assembler", "GiveUp", "Observation", "PhaseMachine", "PhaseTuning"]
