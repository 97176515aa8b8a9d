"""Upper layer of the long-distance phase: a reference that follows the path and stays outside walls."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.feedback.envelope import EnvelopeGains, enveloped_acceleration
from msrr_control.kinematics.elementwise import Number, join, limit, number, split, tanh, where
from msrr_control.kinematics.offset_point import rotated
from msrr_control.path_following.path import Desired
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Positive, Spec


class ReferenceGains(Spec):
    """Gains of the upper layer.

    Attributes:
        c1_per_s: Backstepping gain on the position.
        c2_per_s: Backstepping gain on the velocity.
        u_max_mps2: Largest acceleration of the reference along each axis.
        windup: Its auxiliary system; an acceleration drives it, so k is in m/s2 and gamma in m/s here.
        envelope: The safety envelope before a wall.
    """

    c1_per_s: Positive = 0.8
    c2_per_s: Positive = 1.8
    u_max_mps2: Positive = 0.5
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
        active: Where one stands, shape (...) bool.
        foot: A point of the wall, shape (..., 2) [m].
        normal: Angle of the normal that points to the free side, shape (...) [rad].
    """

    active: NDArray[np.bool_]
    foot: Array
    normal: Array


class ReferenceState(NamedTuple):
    """phi1 [m], phi2 [m/s] and the auxiliary state, each of shape (..., 2)."""

    position: Array
    velocity: Array
    lam: Array


def reference_start(tip: Array, velocity: Array) -> ReferenceState:
    """Start at the measured controlled point and its velocity, each of shape (..., 2)."""
    return ReferenceState(np.array(tip), np.array(velocity), np.zeros_like(tip))


def reference_step(
    state: ReferenceState,
    desired: Desired,
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
        desired: p_d and derivatives.
        wall: The wall that stands now, if any.
        gains: Gains.
        dt: Step [s].
        envelope: False leaves the wall out (ablation).
        anti_windup: False keeps the auxiliary state at zero (ablation).

    Returns:
        The state one step later.
    """
    most = gains.u_max_mps2
    position, velocity, lam = split(state.position), split(state.velocity), split(state.lam)
    point, rate, forward = map(split, desired)
    axes = (0, 1)
    wish = [_wish(position[i], velocity[i], lam[i], point[i], rate[i], forward[i], gains) for i in axes]
    if envelope and bool(np.any(wall.active)):
        acceleration = _kept_out(wish, position, velocity, wall, gains)
    else:
        acceleration = [limit(u, -most, most) for u in wish]
    if anti_windup:
        lam = [auxiliary_step(lam[i], acceleration[i] - wish[i], gains.windup, dt) for i in axes]
    return ReferenceState(
        join(*(position[i] + dt * velocity[i] + 0.5 * dt * dt * acceleration[i] for i in axes)),
        join(*(velocity[i] + dt * acceleration[i] for i in axes)),
        join(*lam),
    )


def _wish(
    position: Number,
    velocity: Number,
    lam: Number,
    desired: Number,
    rate: Number,
    acceleration: Number,
    gains: ReferenceGains,
) -> Number:
    """Return u_r along one axis."""
    k, gamma = gains.windup.k_mps, gains.windup.gamma_m
    c1, c2 = gains.c1_per_s, gains.c2_per_s
    bias = gamma * tanh(lam)
    z1 = position - desired
    z2 = velocity - rate + c1 * z1 - bias
    return -c2 * z2 + acceleration - k * lam - z1 - c1 * (z2 - c1 * z1 + bias)


def _kept_out(
    wish: list[Any], position: list[Any], velocity: list[Any], wall: SideWall, gains: ReferenceGains
) -> list[Any]:
    """Saturate in the frame of the wall, whose first axis is its normal (eq. 9, a lower wall)."""
    most, normal = gains.u_max_mps2, number(wall.normal)
    foot = split(wall.foot)
    wanted, along = rotated(wish[0], wish[1], -normal)
    across, _ = rotated(position[0] - foot[0], position[1] - foot[1], -normal)
    rate, _ = rotated(velocity[0], velocity[1], -normal)
    allowed = enveloped_acceleration(wanted, across, rate, gains.envelope, most, lower=0.0)
    kept = rotated(allowed, limit(along, -most, most), normal)
    # Where no wall stands there is no frame of a wall: the limits are those of the axes, as without.
    return [where(number(wall.active), kept[i], limit(wish[i], -most, most)) for i in (0, 1)]
