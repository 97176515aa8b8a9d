"""The long-distance law C2: our reading of the law with which the paper compares C1.

The paper prints no equations of it; it describes it in words and names a source. Its feedback saturates each
axis of the world by itself, so that its ways depend on the direction of the path in the world.
"""

from __future__ import annotations

from typing import NamedTuple

from msrr_control.feedback.sliding import SlidingGains, sliding_feedback
from msrr_control.kinematics.controlled_point import offset_point, point_velocity, position_error, twist_for
from msrr_control.kinematics.drive_limits import limit_twist
from msrr_control.path_following.obstacle_forces import Obstacles, RepulsionGains, repulsion
from msrr_control.path_following.path import Pace, PaceSpec, Path, pace_start, pace_step
from msrr_control.path_following.reference import ReferenceState, SideWall, reference_start
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Spec
from msrr_scenes.specs.vehicle import LimitsSpec


class C2PathFollowingParams(Spec):
    """Parameters of :class:`C2PathFollowingLaw`.

    Attributes:
        feedback: Sliding feedback with a boundary layer.
        repulsion: Repulsive potential about obstacles.
        pace: Speed along the path. The desired point does not wait for the unit: where path and potential
            balance each other, both would stand for ever.
    """

    feedback: SlidingGains = SlidingGains(k_per_s=1.2, reach_mps=0.05, layer_m=0.05)
    repulsion: RepulsionGains = RepulsionGains()
    pace: PaceSpec = PaceSpec(lag_m=10.0)


class C2PathFollowingState(NamedTuple):
    """State of the law; all arrays share the leading shape of the trials.

    Attributes:
        pace: Arc length and speed of the desired point.
        desired: Desired point of the last step, shape (..., 2) [m].
        guidance: Reference that is tracked: the desired point and its velocity, without an upper layer.
    """

    pace: Pace
    desired: Array
    guidance: ReferenceState


class C2PathFollowingLaw:
    r"""Tracks the path by sliding feedback, with a potential about obstacles, without walls and anti-windup.

    .. math:: u = \dot p_d + u_s(p_l - p_d) + u_o(p_l)

    Source: our reading of the comparison of Zheng et al. (their reference [22]), whose equations they do not
    print. The avoidance is purely radial: it pushes the unit back instead of leading it around the obstacle.
    """

    def __init__(self, params: C2PathFollowingParams, limits: LimitsSpec, offset: float) -> None:
        """Bind the law to its parameters, to the drive's limits and to l [m]."""
        self.params, self.limits, self.offset = params, limits, offset

    def start(self, pose: Array, twist: Array, s: float = 0.0) -> C2PathFollowingState:
        """Return the state at the beginning of a path, or ``s`` [m] into it."""
        tip = offset_point(pose, self.offset)
        velocity = point_velocity(twist, pose[..., 2], self.offset)
        return C2PathFollowingState(pace_start(pose, s), tip, reference_start(tip, velocity))

    def step(
        self,
        state: C2PathFollowingState,
        path: Path,
        pose: Array,
        wall: SideWall,
        obstacles: Obstacles,
        dt: float,
    ) -> tuple[Array, C2PathFollowingState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state. It uses no wall."""
        tip = offset_point(pose, self.offset)
        pace, desired = pace_step(state.pace, path, tip, self.params.pace, dt)
        error = position_error(tip, desired.point)
        velocity = desired.velocity + sliding_feedback(error, self.params.feedback)
        velocity += repulsion(tip, obstacles, self.params.repulsion)
        twist = twist_for(velocity, pose[..., 2], self.offset)
        command = limit_twist(twist, self.limits.v_max_mps, self.limits.w_max_radps)
        tracked = reference_start(desired.point, desired.velocity)
        return command, C2PathFollowingState(pace, desired.point, tracked)
