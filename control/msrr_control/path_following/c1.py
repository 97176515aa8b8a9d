"""The paper's long-distance law C1: pace, upper layer and lower layer in one step."""

from __future__ import annotations

from typing import NamedTuple

from msrr_control.kinematics.controlled_point import offset_point, point_velocity
from msrr_control.path_following.obstacle_forces import Obstacles
from msrr_control.path_following.path import Pace, PaceSpec, Path, pace_start, pace_step
from msrr_control.path_following.reference import (
    ReferenceGains,
    ReferenceState,
    SideWall,
    reference_start,
    reference_step,
)
from msrr_control.path_following.tracking import TrackingGains, TrackingState, tracking_start, tracking_step
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
        pace: Speed along the path.
        envelope: Whether walls keep the reference out.
        anti_windup: Whether the auxiliary systems of both layers are used.
        spring: Whether the virtual spring is used.
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
        pace: Arc length and speed of the desired point.
        desired: Desired point of the last step, shape (..., 2) [m].
        guidance: State of the upper layer.
        tracking: State of the lower layer.
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
        """Return the state at the beginning of a path, or ``s`` [m] into it."""
        tip = offset_point(pose, self.offset)
        velocity = point_velocity(twist, pose[..., 2], self.offset)
        return C1PathFollowingState(
            pace=pace_start(pose, s),
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
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        p = self.params
        tip = offset_point(pose, self.offset)
        pace, desired = pace_step(state.pace, path, tip, p.pace, dt)
        guidance = reference_step(
            state.guidance, desired, wall, p.guidance, dt, envelope=p.envelope, anti_windup=p.anti_windup
        )
        command, tracking = tracking_step(
            state.tracking,
            guidance,
            pose,
            obstacles,
            p.tracking,
            self.limits,
            self.offset,
            dt,
            anti_windup=p.anti_windup,
            spring=p.spring,
        )
        return command, C1PathFollowingState(pace, desired.point, guidance, tracking)
