"""msrr_perception.pose."""
