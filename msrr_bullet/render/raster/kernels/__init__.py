"""Compiled loops of the raster renderer: from faces on moving frames to the pixels of a window."""
