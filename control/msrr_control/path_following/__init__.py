"""The long-distance phase: paths, and the laws that drive a unit along them past obstacles."""

from msrr_control.path_following.law import PathFollowingLaw, PathFollowingState
from msrr_control.path_following.obstacle_forces import Obstacles
from msrr_control.path_following.path import PaceSpec, Path
from msrr_control.path_following.reference import SideWall
from msrr_control.path_following.walls import PassageError, WallSpec

__all__ = [
    "Obstacles",
    "PaceSpec",
    "PassageError",
    "Path",
    "PathFollowingLaw",
    "PathFollowingState",
    "SideWall",
    "WallSpec",
]
