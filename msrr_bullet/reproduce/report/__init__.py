"""msrr_bullet.reproduce.report."""
