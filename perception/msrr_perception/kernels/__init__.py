"""Kernels: the inner loops of perception, compiled by numba. Importing a module compiles nothing yet."""
