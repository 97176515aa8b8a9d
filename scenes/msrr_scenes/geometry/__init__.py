"""Geometry: poses in the plane and in space, the pinhole camera, and the unit as its URDF gives it."""
