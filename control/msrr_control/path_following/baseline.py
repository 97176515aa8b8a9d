"""The long-distance law C2, with which the paper compares its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import model_validator

from msrr_control.feedback.sliding import SlidingGains, sliding_feedback
from msrr_control.kinematics.offset_point import offset_point, point_velocity, twist_for
from msrr_control.path_following.path import Pace, PaceSpec, Path, pace_step
from msrr_control.path_following.reference import ReferenceState, SideWall, reference_start
from msrr_control.path_following.tracking import Obstacles
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Positive, Spec
from msrr_scenes.specs.vehicle import LimitsSpec

#: Errors beyond this [m] are cut: farther than any arena.
_FARTHEST = 100.0


class RepulsionGains(Spec):
    """Gains of the repulsive potential about the middle of each obstacle.

    Attributes:
        eta: Strength of the potential [m4/s].
        range_m: rho_0, distance at which it begins.
        nearest_m: Distance below which its force grows no more.
    """

    eta: Positive = 0.02
    range_m: Positive = 0.65
    nearest_m: Positive = 0.10

    @model_validator(mode="after")
    def _ordered(self) -> RepulsionGains:
        if self.nearest_m >= self.range_m:
            raise ValueError(f"nearest_m = {self.nearest_m:g} has to be less than range_m = {self.range_m:g}")
        return self


def repulsion(tip: Array, obstacles: Obstacles, gains: RepulsionGains) -> Array:
    r"""Return the velocity with which obstacles push the controlled point straight away from them.

    .. math:: u_o = \eta\left(\frac1\rho - \frac1{\rho_0}\right)\frac1{\rho^2}\frac{p_l - p_o}{\rho},\quad
        \rho < \rho_0

    Source: O. Khatib, "Real-time obstacle avoidance for manipulators and mobile robots", 1986.

    Args:
        tip: Controlled point, shape (..., 2) [m].
        obstacles: M obstacles.
        gains: Strength and range.

    Returns:
        Shape (..., 2) [m/s].
    """
    apart = tip[..., None, :] - obstacles.centre
    distance = np.hypot(apart[..., 0], apart[..., 1])
    rho = np.maximum(distance, gains.nearest_m)
    size = gains.eta * np.maximum(1.0 / rho - 1.0 / gains.range_m, 0.0) / rho**2 * obstacles.present
    away = apart / np.maximum(distance, 1e-9)[..., None]
    pushed: Array = np.sum(size[..., None] * away, axis=-2)
    return pushed


class C2PathFollowingParams(Spec):
    """Parameters of :class:`C2PathFollowingLaw`.

    Attributes:
        feedback: Sliding feedback with a boundary layer.
        repulsion: Potential about obstacles.
        pace: How fast the path is followed. It waits for nobody: where path and potential balance each
            other, a unit that is waited for would stand for ever.
    """

    feedback: SlidingGains = SlidingGains(k_per_s=1.2, reach_mps=0.05, layer_m=0.05)
    repulsion: RepulsionGains = RepulsionGains()
    pace: PaceSpec = PaceSpec(lag_m=10.0)


class C2PathFollowingState(NamedTuple):
    """State of the law; all arrays share the leading shape of the trials.

    Attributes:
        pace: Where the desired point is on the path.
        desired: The desired point of the last step, shape (..., 2) [m].
        guidance: What is tracked: the desired point and its velocity, without an upper layer between.
    """

    pace: Pace
    desired: Array
    guidance: ReferenceState


class C2PathFollowingLaw:
    r"""Sliding tracking of the path with a potential about obstacles; no walls, no anti-windup.

    .. math:: u = \dot p_d + u_s(p_l - p_d) + u_o(p_l)

    Source: the comparison of Zheng et al. (their reference [22]). The avoidance is purely radial: it pushes
    back where it should lead around.
    """

    def __init__(self, params: C2PathFollowingParams, limits: LimitsSpec, offset: float) -> None:
        """Bind the law to its parameters, to the drive's limits and to l [m]."""
        self.params, self.limits, self.offset = params, limits, offset

    def start(self, pose: Array, twist: Array, s: float = 0.0) -> C2PathFollowingState:
        """Return the state at the beginning of a path, or ``s`` [m] into it; ``pose`` has shape (..., 3)."""
        tip = offset_point(pose, self.offset)
        at = Pace(np.full(pose.shape[:-1], s), np.zeros(pose.shape[:-1]))
        velocity = point_velocity(twist, pose[..., 2], self.offset)
        return C2PathFollowingState(at, tip, reference_start(tip, velocity))

    def step(
        self,
        state: C2PathFollowingState,
        path: Path,
        pose: Array,
        wall: SideWall,
        obstacles: Obstacles,
        dt: float,
    ) -> tuple[Array, C2PathFollowingState]:
        """Advance by ``dt`` [s] and return (v, w) within the drive's speed limits, shape (..., 2).

        Args:
            state: State of the law.
            path: What to follow.
            pose: Measured axle pose, shape (..., 3).
            wall: Of no use to this law.
            obstacles: What pushes.
            dt: Control period.
        """
        tip = offset_point(pose, self.offset)
        pace, desired = pace_step(state.pace, path, tip, self.params.pace, dt)
        error = np.minimum(np.maximum(tip - desired.point, -_FARTHEST), _FARTHEST)
        velocity = desired.velocity + sliding_feedback(error, self.params.feedback)
        velocity += repulsion(tip, obstacles, self.params.repulsion)
        wish = twist_for(velocity, pose[..., 2], self.offset)
        most = np.array([self.limits.v_max_mps, self.limits.w_max_radps])
        command: Array = np.minimum(np.maximum(wish, -most), most)
        tracked = reference_start(desired.point, desired.velocity)
        return command, C2PathFollowingState(pace, desired.point, tracked)
