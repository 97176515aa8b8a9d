"""Lower layer of the long-distance phase: the drive follows the reference; obstacles push like springs."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.kinematics.drive_limits import nested_limit
from msrr_control.kinematics.elementwise import (
    Number,
    at_least,
    cos,
    hypot,
    join,
    limit,
    number,
    sin,
    split,
    tan,
    tanh,
)
from msrr_control.kinematics.offset_point import rotated
from msrr_control.path_following.reference import ReferenceState
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Positive, Spec
from msrr_scenes.specs.vehicle import LimitsSpec

#: Keeps tan below its pole; the force there is 1 to all digits.
_BELOW_ONE = 1.0 - 1e-6

#: Errors beyond this [m] are cut: farther than any arena.
_FARTHEST = 100.0


class SpringGains(Spec):
    """Gains of the virtual spring.

    It is bounded: 1 to 2 cm of extra margin beside what the walls keep, and no protection by itself.

    Attributes:
        k_r_mps: Largest force.
        near_m: rho_sr, distance from the obstacle's middle at which the force is largest.
        far_m: rho_sR, where it begins.
        windup: Its auxiliary system.
    """

    k_r_mps: Positive = 1.0
    near_m: Positive = 0.20
    far_m: Positive = 0.65
    windup: AuxiliaryGains = AuxiliaryGains(k_mps=1.0, gamma_m=0.02)

    @model_validator(mode="after")
    def _ordered(self) -> SpringGains:
        if self.near_m >= self.far_m:
            raise ValueError(f"near_m = {self.near_m:g} has to be less than far_m = {self.far_m:g}")
        return self


class TrackingGains(Spec):
    """Gains of the lower layer.

    Attributes:
        k_l_per_s: Gain on the position.
        windup: Its auxiliary system; k / gamma has to stay below k_l, else it is a limit cycle.
        spring: The virtual spring.
    """

    k_l_per_s: Positive = 1.2
    windup: AuxiliaryGains = Field(default=AuxiliaryGains(k_mps=0.06, gamma_m=0.10))
    spring: SpringGains = SpringGains()

    @model_validator(mode="after")
    def _windup_below_loop(self) -> TrackingGains:
        if self.windup.bandwidth >= self.k_l_per_s:
            raise ValueError(
                f"windup.k_mps / windup.gamma_m = {self.windup.bandwidth:.3g} 1/s has to stay below k_l_per_s"
                f" = {self.k_l_per_s:.3g} 1/s; else anti-windup is a limit cycle"
            )
        return self


class Obstacles(NamedTuple):
    """Obstacles that are known.

    Attributes:
        centre: Middles, shape (..., M, 2) [m].
        present: Which of them exist, shape (..., M) bool.
    """

    centre: Array
    present: NDArray[np.bool_]


class TrackingState(NamedTuple):
    """Auxiliary states of the tracking and of the spring, and (v_s, w_s); each of shape (..., 2)."""

    lam: Array
    lam_s: Array
    limited: Array


def spring_force(tip: Array, obstacles: Obstacles, gains: SpringGains) -> Array:
    r"""Return Delta_s, the sum of the springs' forces in the inertial frame.

    .. math:: F = k_r\tanh(\tan(\tfrac{\pi}{2}s)),\quad
        s = \mathrm{sat}(0, \frac{\rho_{sR}-\rho}{\rho_{sR}-\rho_{sr}}, 1^-),\quad
        \Delta_s = -F\frac{p_l-p_o}{|p_l-p_o|}

    The sign is such that the minus before lambda_s in the velocity (eq. 18) repels.

    Source: Zheng et al., eqs. 15 and 16; clipped (inside rho_sr the printed force flips and attracts; its
    denominator is zero) and with the inertial direction.

    Args:
        tip: Controlled point, shape (..., 2) [m].
        obstacles: M obstacles.
        gains: Force and range.

    Returns:
        Shape (..., 2) [m/s].
    """
    x, y = split(tip)
    force_x, force_y = 0.0 * x, 0.0 * y
    for i in range(obstacles.centre.shape[-2]):
        centre_x, centre_y = split(obstacles.centre[..., i, :])
        apart_x, apart_y = x - centre_x, y - centre_y
        rho = hypot(apart_x, apart_y)
        share = limit((gains.far_m - rho) / (gains.far_m - gains.near_m), 0.0, _BELOW_ONE)
        size = gains.k_r_mps * tanh(tan(0.5 * math.pi * share)) * number(obstacles.present[..., i])
        each = size / at_least(rho, 1e-9)
        force_x, force_y = force_x - each * apart_x, force_y - each * apart_y
    return join(force_x, force_y)


def tracking_start(twist: Array, limits: LimitsSpec) -> TrackingState:
    """Start from the measured (v, w), shape (..., 2)."""
    nothing = np.zeros_like(twist)
    most = np.array([limits.v_max_mps, limits.w_max_radps])
    return TrackingState(nothing, nothing, np.minimum(np.maximum(twist, -most), most))


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
    command, by a limiter without lag in here (with measured wheel speeds 4.5 to 7.7 mm of bias remain).

    Args:
        state: State of the layer, leading shape (...).
        reference: phi1 and phi2 of the upper layer.
        pose: Axle pose in the frame of the reference, shape (..., 3) [m, m, rad].
        obstacles: What pushes.
        gains: Gains.
        limits: Of the drive.
        offset: l [m].
        dt: Step [s].
        anti_windup: False keeps lambda at zero (ablation).
        spring: False switches the spring off (ablation).

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
    goal, pace = split(reference.position), split(reference.velocity)
    u_x, u_y = (_wish(tip[i], goal[i], pace[i], lam[i], lam_s[i], gains, anti_windup, spring) for i in axes)
    v, across = rotated(u_x, u_y, -yaw)
    w = across / offset
    most_v, most_w = limits.v_max_mps, limits.w_max_radps
    before_v, before_w = split(state.limited)
    limited_v = nested_limit(before_v, v, most_v, limits.a_max_mps2, 1.0 / dt, dt)
    limited_w = nested_limit(before_w, w, most_w, limits.dw_max_radps2, 1.0 / dt, dt)
    if anti_windup:
        excess = rotated(limited_v - v, offset * (limited_w - w), yaw)
        lam = [auxiliary_step(lam[i], excess[i], gains.windup, dt) for i in axes]
    command = join(limit(v, -most_v, most_v), limit(w, -most_w, most_w))
    return command, TrackingState(join(*lam), join(*lam_s), join(limited_v, limited_w))


def _wish(
    tip: Number,
    goal: Number,
    pace: Number,
    lam: Number,
    lam_s: Number,
    gains: TrackingGains,
    anti_windup: bool,
    spring: bool,
) -> Number:
    """Return u_d along one axis."""
    velocity = pace - gains.k_l_per_s * limit(tip - goal, -_FARTHEST, _FARTHEST)
    if anti_windup:
        windup = gains.windup
        velocity = velocity + gains.k_l_per_s * windup.gamma_m * tanh(lam) - windup.k_mps * lam
    if spring:
        velocity = velocity - gains.spring.windup.gamma_m * tanh(lam_s)
    return velocity
