"""The forces by which obstacles push the controlled point away: the spring of C1, the potential of C2."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from msrr_control.feedback.auxiliary import AuxiliaryGains
from msrr_control.kinematics.elementwise import at_least, hypot, join, number, split, tanh_tan
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Length, Positive, Spec, Speed


class Obstacles(NamedTuple):
    """The known obstacles.

    Attributes:
        centre: Middles of M obstacles, shape (..., M, 2) [m].
        present: Which of them exist, shape (..., M) bool.
    """

    centre: Array
    present: NDArray[np.bool_]


class SpringGains(Spec):
    """Gains of the virtual spring.

    Its force is bounded: it adds 1 to 2 cm to the distance that the walls keep, and is no protection by
    itself.

    Attributes:
        k_r_mps: Largest force k_r.
        near_m: rho_sr, distance from the obstacle's middle at which the force is largest.
        far_m: rho_sR, distance from the obstacle's middle at which the force begins.
        windup: Auxiliary system that is driven by the force.
    """

    k_r_mps: Speed = 1.0
    near_m: Length = 0.20
    far_m: Length = 0.65
    windup: AuxiliaryGains = AuxiliaryGains(k_mps=1.0, gamma_m=0.02)

    @model_validator(mode="after")
    def _ordered(self) -> SpringGains:
        if self.near_m >= self.far_m:
            raise ValueError(f"near_m = {self.near_m:g} has to be less than far_m = {self.far_m:g}")
        return self


def spring_force(tip: Array, obstacles: Obstacles, gains: SpringGains) -> Array:
    r"""Return Delta_s, the sum of the forces of the virtual springs in the inertial frame.

    .. math:: F = k_r\tanh(\tan(\tfrac{\pi}{2}s)),\quad
        s = \mathrm{sat}(0, \frac{\rho_{sR}-\rho}{\rho_{sR}-\rho_{sr}}, 1^-),\quad
        \Delta_s = -F\frac{p_l-p_o}{|p_l-p_o|}

    The sign is such that the minus before lambda_s in the velocity (eq. 18) repels.

    Source: Zheng et al., eqs. 15 and 16; clipped (inside rho_sr the printed force flips and attracts; its
    denominator is zero) and with the inertial direction.

    Args:
        tip: Controlled point, shape (..., 2) [m].
        obstacles: The obstacles.
        gains: Force and range.

    Returns:
        Force, shape (..., 2) [m/s].
    """
    x, y = split(tip)
    force_x, force_y = 0.0 * x, 0.0 * y
    for i in range(obstacles.centre.shape[-2]):
        centre_x, centre_y = split(obstacles.centre[..., i, :])
        apart_x, apart_y = x - centre_x, y - centre_y
        rho = hypot(apart_x, apart_y)
        share = (gains.far_m - rho) / (gains.far_m - gains.near_m)
        force = gains.k_r_mps * tanh_tan(share) * number(obstacles.present[..., i])
        per_metre = force / at_least(rho, 1e-9)
        force_x, force_y = force_x - per_metre * apart_x, force_y - per_metre * apart_y
    return join(force_x, force_y)


class RepulsionGains(Spec):
    """Gains of the repulsive potential about the middle of each obstacle.

    Attributes:
        eta: Strength of the potential [m4/s].
        range_m: rho_0, distance from the obstacle's middle at which the potential begins.
        nearest_m: Distance below which the force grows no more.
    """

    eta: Positive = 0.02
    range_m: Length = 0.65
    nearest_m: Length = 0.10

    @model_validator(mode="after")
    def _ordered(self) -> RepulsionGains:
        if self.nearest_m >= self.range_m:
            raise ValueError(f"nearest_m = {self.nearest_m:g} has to be less than range_m = {self.range_m:g}")
        return self


def repulsion(tip: Array, obstacles: Obstacles, gains: RepulsionGains) -> Array:
    r"""Return the velocity by which obstacles push the controlled point straight away from them.

    .. math:: u_o = \eta\left(\frac1\rho - \frac1{\rho_0}\right)\frac1{\rho^2}\frac{p_l - p_o}{\rho},\quad
        \rho < \rho_0

    Source: O. Khatib, "Real-time obstacle avoidance for manipulators and mobile robots", 1986.

    Args:
        tip: Controlled point, shape (..., 2) [m].
        obstacles: The obstacles.
        gains: Strength and range.

    Returns:
        Velocity, shape (..., 2) [m/s].
    """
    apart = tip[..., None, :] - obstacles.centre
    distance = np.hypot(apart[..., 0], apart[..., 1])
    rho = np.maximum(distance, gains.nearest_m)
    speed = gains.eta * np.maximum(1.0 / rho - 1.0 / gains.range_m, 0.0) / rho**2 * obstacles.present
    away = apart / np.maximum(distance, 1e-9)[..., None]
    velocity: Array = np.sum(speed[..., None] * away, axis=-2)
    return velocity
