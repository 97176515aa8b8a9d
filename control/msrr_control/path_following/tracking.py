"""The lower layer of the long-distance law C1: tracking of the reference, repelled by obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import model_validator

from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.kinematics.controlled_point import position_error, rotate_components
from msrr_control.kinematics.drive_limits import limit_twist, nested_limit
from msrr_control.kinematics.elementwise import cos, join, limit, sin, split, tanh
from msrr_control.path_following.obstacle_forces import Obstacles, SpringGains, spring_force
from msrr_control.path_following.reference import ReferenceState
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Gain, Spec
from msrr_scenes.specs.vehicle import LimitsSpec

#: What Young's inequality takes from k_l [1/s] in eq. 20 for the velocity by which the spring pushes.
LEAST_K_L = 0.25


class TrackingGains(Spec):
    """Gains of the lower layer.

    Attributes:
        k_l_per_s: Gain k_l on the position, above 1/4 1/s: eq. 20 proves a decay at k_l - 1/4.
        windup: Auxiliary system; its k / gamma has to stay below k_l, else it is a limit cycle.
        spring: Virtual spring.
    """

    k_l_per_s: Gain = 1.2
    windup: AuxiliaryGains = AuxiliaryGains(k_mps=0.06, gamma_m=0.10)
    spring: SpringGains = SpringGains()

    @model_validator(mode="after")
    def _gain_leaves_decay(self) -> TrackingGains:
        if self.k_l_per_s <= LEAST_K_L:
            raise ValueError(
                f"k_l_per_s = {self.k_l_per_s:.3g} has to be more than {LEAST_K_L:g} 1/s: eq. 20 proves a"
                f" decay at k_l - {LEAST_K_L:g}, and at or below that nothing is left of it"
            )
        return self

    @model_validator(mode="after")
    def _windup_below_loop(self) -> TrackingGains:
        self.windup.check_below(self.k_l_per_s, "k_l_per_s")
        return self


class TrackingState(NamedTuple):
    """State of the lower layer, each part of shape (..., 2).

    Attributes:
        lam: Auxiliary state lambda of the tracking.
        lam_s: Auxiliary state lambda_s of the spring.
        limited: (v_s, w_s) behind the law's own magnitude and rate limiter, which has no lag.
    """

    lam: Array
    lam_s: Array
    limited: Array


def tracking_start(twist: Array, limits: LimitsSpec) -> TrackingState:
    """Return the state at the beginning of a path, from the measured (v, w), shape (..., 2)."""
    zero = np.zeros_like(twist)
    return TrackingState(zero, zero, limit_twist(twist, limits.v_max_mps, limits.w_max_radps))


def tracking_step(
    state: TrackingState,
    reference: ReferenceState,
    pose: Array,
    obstacles: Obstacles,
    gains: TrackingGains,
    limits: LimitsSpec,
    offset: float,
    dt: float,
    *,
    anti_windup: bool = True,
    spring: bool = True,
) -> tuple[Array, TrackingState]:
    r"""Advance the tracking by ``dt`` and return the command.

    .. math:: e = p_l - \phi_1 - \gamma\tanh\lambda,\quad
        u_d = -k_l e + \phi_2 - k\lambda - \gamma_s\tanh\lambda_s

    Source: Zheng et al., eqs. 14 to 20. Delta of eq. 14 is what the magnitude and rate limits take from the
    command, computed by a limiter without lag (with measured wheel speeds 4.5 to 7.7 mm of bias remain).

    Args:
        state: State of the layer, leading shape (...).
        reference: phi1 and phi2 of the upper layer.
        pose: Axle pose in the frame of the reference, shape (..., 3) [m, m, rad].
        obstacles: Obstacles to which springs are attached.
        gains: Gains of the layer.
        limits: What the drive can do.
        offset: l [m].
        dt: Step [s].
        anti_windup: False keeps lambda at zero (ablation).
        spring: False keeps lambda_s at zero, without a force (ablation).

    Returns:
        (v, w) within the drive's speed limits, shape (..., 2), and the next state.
    """
    x, y, yaw = split(pose)
    tip = x + offset * cos(yaw), y + offset * sin(yaw)
    lam, lam_s = split(state.lam), split(state.lam_s)
    axes = (0, 1)
    if spring:
        force = split(spring_force(join(*tip), obstacles, gains.spring))
        lam_s = [auxiliary_step(lam_s[i], force[i], gains.spring.windup, dt) for i in axes]
    goal, rate = split(reference.position), split(reference.velocity)
    windup, gamma_s = gains.windup, gains.spring.windup.gamma_m
    velocity = []
    for i in axes:
        u_d = rate[i] - gains.k_l_per_s * position_error(tip[i], goal[i])
        u_d = u_d + gains.k_l_per_s * windup.gamma_m * tanh(lam[i]) - windup.k_mps * lam[i]
        velocity.append(u_d - gamma_s * tanh(lam_s[i]))
    v, across = rotate_components(velocity[0], velocity[1], -yaw)
    w = across / offset
    max_v, max_w = limits.v_max_mps, limits.w_max_radps
    previous_v, previous_w = split(state.limited)
    limited_v = nested_limit(previous_v, v, max_v, limits.a_max_mps2, 1.0 / dt, dt)
    limited_w = nested_limit(previous_w, w, max_w, limits.dw_max_radps2, 1.0 / dt, dt)
    if anti_windup:
        excess = rotate_components(limited_v - v, offset * (limited_w - w), yaw)
        lam = [auxiliary_step(lam[i], excess[i], windup, dt) for i in axes]
    command = join(limit(v, -max_v, max_v), limit(w, -max_w, max_w))
    return command, TrackingState(join(*lam), join(*lam_s), join(limited_v, limited_w))
