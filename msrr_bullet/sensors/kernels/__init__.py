"""Kernels: the inner loops of the sensors, compiled by numba. Importing a module compiles nothing yet."""
