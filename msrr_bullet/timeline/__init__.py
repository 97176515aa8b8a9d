"""msrr_bullet.timeline."""
