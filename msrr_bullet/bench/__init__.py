"""Benchmarks of a trial's speed, of the renderers, and of the settings of the tag detection.

The modules load the simulator, numba and the detector, so import from them by name.
"""
