"""The close-range phase: the laws that drive a unit into the port, and the controllers that run them."""

from msrr_control.docking.controller import ControlInputs, Controller, LawController, build_controller
from msrr_control.docking.law import DockingLaw, DockSetup

__all__ = ["ControlInputs", "Controller", "DockSetup", "DockingLaw", "LawController", "build_controller"]
