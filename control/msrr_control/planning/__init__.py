"""msrr_control.planning."""
