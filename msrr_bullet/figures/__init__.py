"""msrr_bullet.figures."""
