"""The close-range phase: the laws that drive a unit into the port, and the controllers that run them."""

from msrr_control.docking.controller import (
    CONTROLLERS,
    ControlInputs,
    Controller,
    LawController,
    build_controller,
    law_inputs,
)
from msrr_control.docking.law import DockingLaw, DockSetup, LawInputs
from msrr_control.docking.retreat import RetreatSpec, retreat_twist

__all__ = [
    "CONTROLLERS",
    "ControlInputs",
    "Controller",
    "DockSetup",
    "DockingLaw",
    "LawController",
    "LawInputs",
    "RetreatSpec",
    "build_controller",
    "law_inputs",
    "retreat_twist",
]
