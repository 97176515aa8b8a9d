"""Benchmarks of what exists already: the speed of a trial, the renderers, the settings of the tag detector.

Its modules are imported from by name, because they load the simulator, numba and the detector.
"""
