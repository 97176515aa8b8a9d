"""Placement: where all bodies stand at the start of a trial, and the ground that they can cover there."""

from msrr_scenes.placement.placement import Placement, draw_placement

__all__ = ["Placement", "draw_placement"]
