"""msrr_bullet.trial."""
