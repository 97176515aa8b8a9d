"""msrr_control.path_following."""
