"""Checks of a scene against its bodies as simulation and renderer have them, and against its shapes."""
