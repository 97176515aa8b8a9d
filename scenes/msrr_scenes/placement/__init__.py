"""msrr_scenes.placement."""
