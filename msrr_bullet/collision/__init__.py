"""msrr_bullet.collision."""
