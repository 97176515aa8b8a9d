"""The motion of differential-drive units: the controlled point, the limits of the drive, the ideal unicycle.

The functions take one unit or any number of them; :mod:`~msrr_control.kinematics.elementwise` makes that
possible.
"""
