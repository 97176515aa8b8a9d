"""The interface of a long-distance law: a pure step over arrays, the same code for one robot and for many."""

from __future__ import annotations

from typing import Protocol, TypeVar

from msrr_control.path_following.obstacle_forces import Obstacles
from msrr_control.path_following.path import Pace, Path
from msrr_control.path_following.reference import ReferenceState, SideWall
from msrr_scenes.arrays import Array


class PathFollowingState(Protocol):
    """State of a law: at least these three, and whatever else the law needs."""

    @property
    def pace(self) -> Pace:
        """Arc length and speed of the desired point."""
        ...

    @property
    def desired(self) -> Array:
        """Desired point of the last step, shape (..., 2) [m]."""
        ...

    @property
    def guidance(self) -> ReferenceState:
        """Reference that the controlled point tracks."""
        ...


State = TypeVar("State", bound=PathFollowingState)


class PathFollowingLaw(Protocol[State]):
    """A long-distance law with explicit state: the law itself keeps nothing between calls."""

    def start(self, pose: Array, twist: Array, s: float = 0.0) -> State:
        """Return the state at the beginning of a path.

        Args:
            pose: Axle pose, shape (..., 3) [m, m, rad].
            twist: Measured (v, w), shape (..., 2) [m/s, rad/s].
            s: Arc length at which the desired point begins [m].
        """
        ...

    def step(
        self, state: State, path: Path, pose: Array, wall: SideWall, obstacles: Obstacles, dt: float
    ) -> tuple[Array, State]:
        """Advance the law by one control period.

        Args:
            state: State of the law.
            path: Path to follow.
            pose: Measured axle pose, shape (..., 3).
            wall: Wall that stands now, if any.
            obstacles: Obstacles that repel.
            dt: Control period [s].

        Returns:
            The commanded (v, w) within the drive's speed limits, shape (..., 2), and the next state.
        """
        ...
