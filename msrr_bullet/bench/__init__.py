"""msrr_bullet.bench."""
