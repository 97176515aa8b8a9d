"""Batches of simulated unicycles: a controller in a setting as figures, over time, or tuned."""
