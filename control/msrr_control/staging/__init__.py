"""The long-distance phase as a whole: its states, its parameters, and the follower of its routes."""

from msrr_control.staging.feasibility import check_assembly, check_time
from msrr_control.staging.registry import build_assembler
from msrr_control.staging.setup import AssemblySetup
from msrr_control.staging.state_machine import LongDistanceAssembler

__all__ = ["AssemblySetup", "LongDistanceAssembler", "build_assembler", "check_assembly", "check_time"]
