"""Poses from tag corners: the known geometry of cameras and tags, and least squares over the corners.

The package root exports nothing: its modules load numba and OpenCV.
"""
