"""msrr_bullet.robot."""
