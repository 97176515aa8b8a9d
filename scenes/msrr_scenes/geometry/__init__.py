"""msrr_scenes.geometry."""
