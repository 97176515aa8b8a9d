"""Footprints of units and obstacles, and exact distances between them, computed with FCL."""
