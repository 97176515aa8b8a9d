"""msrr_bullet.simulation."""
