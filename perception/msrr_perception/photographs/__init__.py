"""Photographs: reads pictures and films, finds all tags in them, and computes both poses of each tag.

The package root exports nothing: its modules load OpenCV and the native AprilTag library.
"""
