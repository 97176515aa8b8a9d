"""The long-distance phase: paths, and the laws that drive a unit along them past obstacles."""

from msrr_control.path_following.law import PathFollowingLaw
from msrr_control.path_following.path import PaceSpec, Path
from msrr_control.path_following.walls import WallSpec

__all__ = ["PaceSpec", "Path", "PathFollowingLaw", "WallSpec"]
