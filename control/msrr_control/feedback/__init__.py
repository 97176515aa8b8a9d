"""msrr_control.feedback."""
