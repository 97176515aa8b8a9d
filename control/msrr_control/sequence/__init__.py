"""msrr_control.sequence."""
