"""msrr_control.docking."""
