"""Estimation: filters that combine tag corners and wheel odometry, and the line of sight to the target.

The package root exports nothing: its modules load numba, OpenCV and SciPy.
"""
