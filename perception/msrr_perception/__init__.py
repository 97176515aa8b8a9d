"""Perception: pixels to tag corners to poses, the line of sight, and the filter. It never sees truth."""
