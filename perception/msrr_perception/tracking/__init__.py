"""Tracking: where every body in the arena is, by the overhead camera and the wheels of one unit.

The package root exports nothing: its modules load numba and OpenCV.
"""
