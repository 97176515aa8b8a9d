"""Tracks: all poses that a unit passes on its route, how they are found, and how far a unit may drive."""
