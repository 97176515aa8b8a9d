"""Footprints of units and obstacles, and exact distances between them, computed with FCL."""

from msrr_bullet.collision.clearance import Clearance, Pair
from msrr_bullet.collision.clearance_model import ClearanceModel
from msrr_bullet.collision.footprint import Part, obstacle_parts, unit_parts

__all__ = [
    "Clearance",
    "ClearanceModel",
    "Pair",
    "Part",
    "obstacle_parts",
    "unit_parts",
]
