"""msrr_scenes.specs."""
