"""msrr_control.kinematics."""
