"""Placement: where all bodies stand at the start of a trial, and the ground that they can cover there."""
