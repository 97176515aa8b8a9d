"""msrr_bullet.sweep."""
