"""msrr_perception.estimation."""
