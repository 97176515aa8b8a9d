"""msrr_bullet.sensors."""
