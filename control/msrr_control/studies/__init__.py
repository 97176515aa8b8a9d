"""msrr_control.studies."""
