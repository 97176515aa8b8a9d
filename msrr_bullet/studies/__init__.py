"""msrr_bullet.studies."""
