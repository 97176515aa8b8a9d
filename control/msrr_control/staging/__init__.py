"""msrr_control.staging."""
