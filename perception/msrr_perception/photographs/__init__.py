"""Photographs: files of pictures and films read, all tags found in them, and both poses of each tag.

The package root exports nothing: its modules load OpenCV and the native AprilTag library.
"""
