"""What a law of the long-distance phase is: a pure step over arrays, as in ``docking.law``."""

from __future__ import annotations

from typing import Protocol, TypeVar

from msrr_control.path_following.path import Pace, Path
from msrr_control.path_following.reference import SideWall
from msrr_control.path_following.tracking import Obstacles
from msrr_scenes.arrays import Array


class PathFollowingState(Protocol):
    """State of a law: whatever it needs, and at least these."""

    @property
    def pace(self) -> Pace:
        """Where the desired point is on the path."""
        ...

    @property
    def desired(self) -> Array:
        """The desired point of the last step, shape (..., 2) [m]."""
        ...


State = TypeVar("State", bound=PathFollowingState)


class PathFollowingLaw(Protocol[State]):
    """A long-distance law with explicit state. It keeps nothing between calls."""

    def start(self, pose: Array, twist: Array, s: float = 0.0) -> State:
        """Return the state with which a path begins, or ``s`` [m] into it."""
        ...

    def step(
        self, state: State, path: Path, pose: Array, wall: SideWall, obstacles: Obstacles, dt: float
    ) -> tuple[Array, State]:
        """Return the commanded (v, w), shape (..., 2), within the speed limits, and the next state."""
        ...
