"""Compiled loops that turn faces on moving frames into the pixels of a window."""
