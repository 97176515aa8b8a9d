"""Detection: the choice of the pixel windows of an exposure, and the AprilTag corners found in them.

The package root exports nothing: its modules load numba and the native AprilTag library.
"""
