"""The motion of differential-drive units: the controlled point, the limits of the drive, the ideal unicycle.

The functions take one unit or any number of them; :mod:`~msrr_control.kinematics.elementwise` makes that
possible.
"""

from msrr_control.kinematics.controlled_point import offset_point, point_velocity, twist_for
from msrr_control.kinematics.drive_limits import nested_limit, nested_limiter
from msrr_control.kinematics.unicycle import advance_pose

__all__ = ["advance_pose", "nested_limit", "nested_limiter", "offset_point", "point_velocity", "twist_for"]
