"""The long-distance phase as a whole: its states, its parameters, and the follower of its routes."""

from msrr_control.staging.feasibility import check_assembly
from msrr_control.staging.parameters import AssemblyParams
from msrr_control.staging.registry import ASSEMBLERS, build_assembler
from msrr_control.staging.setup import AssemblySetup
from msrr_control.staging.state_machine import AssemblyState, LongDistanceAssembler

__all__ = [
    "ASSEMBLERS",
    "AssemblyParams",
    "AssemblySetup",
    "AssemblyState",
    "LongDistanceAssembler",
    "build_assembler",
    "check_assembly",
]
