"""Shapes: trees of units that are docked, the order of docking, and the way from one shape to another."""
