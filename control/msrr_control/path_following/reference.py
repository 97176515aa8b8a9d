"""The upper layer of the long-distance law C1: a reference that follows the path and stays outside walls."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.feedback.envelope import EnvelopeGains, enveloped_acceleration
from msrr_control.kinematics.controlled_point import rotate_components
from msrr_control.kinematics.elementwise import join, limit, number, split, tanh, where
from msrr_control.path_following.path import DesiredPoint
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Acceleration, Gain, Spec


class ReferenceGains(Spec):
    """Gains of the upper layer.

    Attributes:
        c1_per_s: Backstepping gain c1 on the position.
        c2_per_s: Backstepping gain c2 on the velocity.
        u_max_mps2: Largest acceleration of the reference along each axis.
        windup: Auxiliary system; an acceleration drives it, so k is in m/s2 and gamma in m/s.
        envelope: Safety envelope before a wall.
    """

    c1_per_s: Gain = 0.8
    c2_per_s: Gain = 1.8
    u_max_mps2: Acceleration = 0.5
    windup: AuxiliaryGains = AuxiliaryGains(k_mps=0.10, gamma_m=0.05)
    envelope: EnvelopeGains = EnvelopeGains()

    @model_validator(mode="after")
    def _consistent(self) -> ReferenceGains:
        if self.envelope.gamma >= self.u_max_mps2:
            raise ValueError(
                f"envelope.gamma = {self.envelope.gamma:g} m/s2 has to be less than u_max_mps2 = "
                f"{self.u_max_mps2:g}, or a wall would ask for more braking than there is"
            )
        if self.windup.bandwidth > 1.5 * self.c2_per_s:
            raise ValueError(
                f"windup.k_mps / windup.gamma_m = {self.windup.bandwidth:.3g} 1/s has to stay near or below "
                f"c2_per_s = {self.c2_per_s:.3g} 1/s"
            )
        return self


class SideWall(NamedTuple):
    """A straight wall beside an obstacle; the reference stays on the side its normal points to.

    Attributes:
        active: Whether the wall stands, shape (...) bool.
        foot: Point of the wall, shape (..., 2) [m].
        normal: Angle of the normal that points to the free side, shape (...) [rad].
    """

    active: NDArray[np.bool_]
    foot: Array
    normal: Array


class ReferenceState(NamedTuple):
    """Position phi1 [m], velocity phi2 [m/s] and auxiliary state lambda_phi, each of shape (..., 2)."""

    position: Array
    velocity: Array
    lam: Array


def reference_start(tip: Array, velocity: Array) -> ReferenceState:
    """Return a reference at the measured controlled point and its velocity, each of shape (..., 2)."""
    return ReferenceState(np.array(tip), np.array(velocity), np.zeros_like(tip))


def reference_step(
    state: ReferenceState,
    desired: DesiredPoint,
    wall: SideWall,
    gains: ReferenceGains,
    dt: float,
    *,
    envelope: bool = True,
    anti_windup: bool = True,
) -> ReferenceState:
    r"""Advance the reference by ``dt``.

    .. math:: z_1 = \phi_1 - p_d,\quad z_2 = \phi_2 - (\dot p_d - c_1 z_1) - \gamma_\phi\tanh\lambda_\phi

        u_r = -c_2 z_2 + \ddot p_d - k_\phi\lambda_\phi - z_1
            - c_1(z_2 - c_1 z_1 + \gamma_\phi\tanh\lambda_\phi)

        \dot\phi_1 = \phi_2,\quad \dot\phi_2 = a_\phi = \mathrm{sat}(u_r),\quad \Delta = a_\phi - u_r

    The saturation is Lemma 1's envelope before the wall, and u_max along and across it. phi integrates the
    enveloped acceleration; that of u_r diverges by metres.

    Source: Zheng et al., eqs. 8 to 13; in u_r the printed c1 (z2 + c1 z1) has a wrong sign and lacks the last
    term of z1's derivative.

    Args:
        state: Reference and auxiliary state, leading shape (...).
        desired: p_d and its derivatives.
        wall: Wall that stands now, if any.
        gains: Gains of the layer.
        dt: Step [s].
        envelope: False leaves the wall out (ablation).
        anti_windup: False keeps the auxiliary state at zero (ablation).

    Returns:
        The state one step later.
    """
    u_max = gains.u_max_mps2
    position, velocity, lam = split(state.position), split(state.velocity), split(state.lam)
    point, rate, acceleration_d = map(split, desired)
    axes = (0, 1)
    k, gamma, c1, c2 = gains.windup.k_mps, gains.windup.gamma_m, gains.c1_per_s, gains.c2_per_s
    u_r = []
    for i in axes:
        bias = gamma * tanh(lam[i])
        z1 = position[i] - point[i]
        z2 = velocity[i] - rate[i] + c1 * z1 - bias
        u_r.append(-c2 * z2 + acceleration_d[i] - k * lam[i] - z1 - c1 * (z2 - c1 * z1 + bias))
    if envelope and bool(wall.active.any()):
        acceleration = _saturate_at_wall(u_r, position, velocity, wall, gains)
    else:
        acceleration = [limit(u, -u_max, u_max) for u in u_r]
    if anti_windup:
        lam = [auxiliary_step(lam[i], acceleration[i] - u_r[i], gains.windup, dt) for i in axes]
    return ReferenceState(
        join(*(position[i] + dt * velocity[i] + 0.5 * dt * dt * acceleration[i] for i in axes)),
        join(*(velocity[i] + dt * acceleration[i] for i in axes)),
        join(*lam),
    )


def _saturate_at_wall(
    u_r: list[Any], position: list[Any], velocity: list[Any], wall: SideWall, gains: ReferenceGains
) -> list[Any]:
    """Saturate u_r in the frame of the wall, whose first axis is the wall's normal (eq. 9, a lower wall)."""
    u_max, normal = gains.u_max_mps2, number(wall.normal)
    foot = split(wall.foot)
    wanted, along = rotate_components(u_r[0], u_r[1], -normal)
    across, _ = rotate_components(position[0] - foot[0], position[1] - foot[1], -normal)
    rate, _ = rotate_components(velocity[0], velocity[1], -normal)
    allowed = enveloped_acceleration(wanted, across, rate, gains.envelope, u_max)
    walled = rotate_components(allowed, limit(along, -u_max, u_max), normal)
    # Trials without a wall have no wall's frame: their accelerations are limited along the axes.
    return [where(number(wall.active), walled[i], limit(u_r[i], -u_max, u_max)) for i in (0, 1)]
