"""Geometry: poses in the plane and in space, the pinhole camera, and the unit as its URDF gives it."""

from msrr_scenes.geometry.pinhole import PinholeCamera, Window, optical_pose
from msrr_scenes.geometry.se2 import SE2, wrap_angle
from msrr_scenes.geometry.se3 import SE3
from msrr_scenes.geometry.unit_geometry import UnitGeometry, find_urdf, read_unit, tag_corners

__all__ = [
    "SE2",
    "SE3",
    "PinholeCamera",
    "UnitGeometry",
    "Window",
    "find_urdf",
    "optical_pose",
    "read_unit",
    "tag_corners",
    "wrap_angle",
]
