"""Calibration of a camera: finds boards in pictures, and fits the model of the lens to their corners.

The package root exports nothing: its modules load OpenCV and the native AprilTag library.
"""
