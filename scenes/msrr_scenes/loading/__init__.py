"""msrr_scenes.loading."""
