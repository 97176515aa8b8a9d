"""Calibration of a camera: boards found in pictures, and the lens that shows them as they were seen.

The package root exports nothing: its modules load OpenCV and the native AprilTag library.
"""
