"""The paper's long-distance law C1: upper layer, lower layer and pace in one step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from msrr_control.kinematics.offset_point import offset_point, point_velocity
from msrr_control.path_following.path import Pace, PaceSpec, Path, pace_step
from msrr_control.path_following.reference import (
    ReferenceGains,
    ReferenceState,
    SideWall,
    reference_start,
    reference_step,
)
from msrr_control.path_following.tracking import (
    Obstacles,
    TrackingGains,
    TrackingState,
    tracking_start,
    tracking_step,
)
from msrr_control.path_following.walls import WallSpec
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Spec
from msrr_scenes.specs.vehicle import LimitsSpec


class C1PathFollowingParams(Spec):
    """Parameters of :class:`C1PathFollowingLaw`; the three switches are ablations.

    Attributes:
        guidance: Upper layer (eqs. 8 to 13).
        tracking: Lower layer (eqs. 14 to 20).
        walls: Walls beside obstacles (eq. 9).
        pace: How fast the path is followed.
        envelope: Keep the reference outside the walls.
        anti_windup: Use the auxiliary systems of both layers.
        spring: Use the virtual spring.
    """

    guidance: ReferenceGains = ReferenceGains()
    tracking: TrackingGains = TrackingGains()
    walls: WallSpec = WallSpec()
    pace: PaceSpec = PaceSpec()
    envelope: bool = True
    anti_windup: bool = True
    spring: bool = True


class C1PathFollowingState(NamedTuple):
    """State of the law; all arrays share the leading shape of the trials.

    Attributes:
        pace: Where the desired point is on the path.
        desired: The desired point of the last step, shape (..., 2) [m].
        guidance: Upper layer.
        tracking: Lower layer.
    """

    pace: Pace
    desired: Array
    guidance: ReferenceState
    tracking: TrackingState


class C1PathFollowingLaw:
    """The long-distance law C1 (Zheng et al., eqs. 8 to 20) in its corrected form."""

    def __init__(self, params: C1PathFollowingParams, limits: LimitsSpec, offset: float) -> None:
        """Bind the law to its parameters, to the drive's limits and to l [m]."""
        self.params, self.limits, self.offset = params, limits, offset

    def start(self, pose: Array, twist: Array, s: float = 0.0) -> C1PathFollowingState:
        """Return the state at the beginning of a path, or ``s`` [m] into it.

        Args:
            pose: Axle pose, shape (..., 3) [m, m, rad].
            twist: Measured (v, w), shape (..., 2).
            s: Where the desired point begins.
        """
        tip = offset_point(pose, self.offset)
        velocity = point_velocity(twist, pose[..., 2], self.offset)
        return C1PathFollowingState(
            pace=Pace(np.full(pose.shape[:-1], s), np.zeros(pose.shape[:-1])),
            desired=tip,
            guidance=reference_start(tip, velocity),
            tracking=tracking_start(twist, self.limits),
        )

    def step(
        self,
        state: C1PathFollowingState,
        path: Path,
        pose: Array,
        wall: SideWall,
        obstacles: Obstacles,
        dt: float,
    ) -> tuple[Array, C1PathFollowingState]:
        """Advance by ``dt`` [s] and return (v, w) within the drive's speed limits, shape (..., 2).

        Args:
            state: State of the law.
            path: What to follow.
            pose: Measured axle pose, shape (..., 3).
            wall: The wall that stands now, if any.
            obstacles: What the springs push off from.
            dt: Control period.
        """
        params = self.params
        tip = offset_point(pose, self.offset)
        pace, desired = pace_step(state.pace, path, tip, params.pace, dt)
        guidance = reference_step(
            state.guidance,
            desired,
            wall,
            params.guidance,
            dt,
            envelope=params.envelope,
            anti_windup=params.anti_windup,
        )
        command, tracking = tracking_step(
            state.tracking,
            guidance,
            pose,
            obstacles,
            params.tracking,
            self.limits,
            self.offset,
            dt,
            anti_windup=params.anti_windup,
            spring=params.spring,
        )
        return command, C1PathFollowingState(pace, desired.point, guidance, tracking)
