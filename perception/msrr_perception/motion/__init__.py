"""Motion: the state of the corner filter, how the wheels move it, and how uncertain that makes it.

The package root exports nothing: its modules load numba.
"""
