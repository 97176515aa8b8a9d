"""msrr_bullet.replay."""
