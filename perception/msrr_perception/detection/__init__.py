"""msrr_perception.detection."""
