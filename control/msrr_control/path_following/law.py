"""The interface of a long-distance law: a pure step over arrays, the same code for one robot and for many."""

from __future__ import annotations

from typing import Protocol, TypeVar

from msrr_control.path_following.obstacle_forces import Obstacles
from msrr_control.path_following.path import Pace, Path
from msrr_control.path_following.reference import SideWall
from msrr_scenes.arrays import Array


class PathFollowingState(Protocol):
    """State of a law: at least these two, and whatever else the law needs."""

    @property
    def pace(self) -> Pace:
        """Arc length and speed of the desired point."""
        ...

    @property
    def desired(self) -> Array:
        """Desired point of the last step, shape (..., 2) [m]."""
        ...


State = TypeVar("State", bound=PathFollowingState)


class PathFollowingLaw(Protocol[State]):
    """A long-distance law with explicit state: the law itself keeps nothing between calls."""

    def start(self, pose: Array, twist: Array, s: float = 0.0) -> State:
        """Return the state with which a path begins, or ``s`` [m] into it."""
        ...

    def step(
        self, state: State, path: Path, pose: Array, wall: SideWall, obstacles: Obstacles, dt: float
    ) -> tuple[Array, State]:
        """Return the commanded (v, w), shape (..., 2), within the speed limits, and the next state."""
        ...
