"""msrr_bullet.plant."""
