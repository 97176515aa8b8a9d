"""The safety envelope of a double integrator: the speed at which it may approach a bound."""

from __future__ import annotations

import math

from msrr_control.kinematics.elementwise import (
    Number,
    at_least,
    at_most,
    exp,
    limit,
    log1p,
    sqrt,
    tanh,
    where,
)
from msrr_scenes.specs.spec import Gain, Positive, Spec

_LOG_2 = math.log(2.0)

#: Below this ln cosh(z) is z^2 / 2 to all digits that matter, and the general formula loses some.
_SMALL = 1e-3


class EnvelopeGains(Spec):
    """Gains of the envelope, which holds only if ``gamma`` is less than the available acceleration.

    Attributes:
        gamma: Deceleration that the envelope asks for [units/s2].
        rho: Length over which the envelope rounds off near the bound [units].
        alpha_per_s: Rate at which the state returns to a violated envelope.
    """

    gamma: Positive = 0.28
    rho: Positive = 0.045
    alpha_per_s: Gain = 2.4


def braking_speed(distance: Number, gains: EnvelopeGains) -> Number:
    r"""Return the speed from which ``gamma`` stops within ``distance`` of the bound, rounded off near it.

    .. math:: \beta(x) = \sqrt{2\gamma\rho\ln\cosh(x/\rho)}

    Source: Zheng et al., eq. 5. ln cosh is written so that it neither overflows nor cancels.
    """
    z = abs(distance) / gains.rho
    small_z = at_most(z, _SMALL)
    log_cosh: Number = where(z < _SMALL, 0.5 * small_z * small_z, z + log1p(exp(-2.0 * z)) - _LOG_2)
    return sqrt(2.0 * gains.gamma * gains.rho * at_least(log_cosh, 0.0))


def envelope(position: Number, gains: EnvelopeGains) -> Number:
    r"""Return F, the largest speed towards the bound that is safe at ``position``.

    .. math:: F(x) = \beta(x)\ (x \le 0),\quad -\sqrt{\gamma/\rho}\,x\ (x > 0)

    Source: Zheng et al., eqs. 4 and 5; the sign is corrected (the printed one drives the state away).

    Args:
        position: eta1, safe where it is not positive, any shape [units].
        gains: gamma and rho.

    Returns:
        F, same shape [units/s]; negative beyond the bound, which pulls the state back.
    """
    outside = -math.sqrt(gains.gamma / gains.rho) * position
    speed: Number = where(position <= 0.0, braking_speed(position, gains), outside)
    return speed


def envelope_slope(position: Number, gains: EnvelopeGains) -> Number:
    r"""Return H = dF/dx.

    .. math:: H(x) = \gamma\tanh(x/\rho)/\beta(x)\ (x < 0),\quad -\sqrt{\gamma/\rho}\ (x \ge 0)

    Source: Zheng et al., eq. 6, written per branch (the printed product loses a term).
    """
    beta = braking_speed(position, gains)
    inside = position < -_SMALL * _SMALL * gains.rho
    slope_inside = gains.gamma * tanh(position / gains.rho) / where(inside, beta, 1.0)
    slope: Number = where(inside, slope_inside, -math.sqrt(gains.gamma / gains.rho))
    return slope


def safe_acceleration(position: Number, velocity: Number, gains: EnvelopeGains) -> Number:
    r"""Return u_s, the largest acceleration towards the bound that keeps the envelope.

    .. math:: B = \eta_2 - F(\eta_1),\quad u_s = -\alpha B + H(\eta_1)\,\eta_2

    Source: Zheng et al., Lemma 1.

    Args:
        position: eta1, any shape [units].
        velocity: eta2, its rate, same shape [units/s].
        gains: gamma, rho, alpha.

    Returns:
        u_s, same shape [units/s2].
    """
    excess = velocity - envelope(position, gains)
    return -gains.alpha_per_s * excess + envelope_slope(position, gains) * velocity


def enveloped_acceleration(
    wanted: Number, position: Number, velocity: Number, gains: EnvelopeGains, max_acceleration: float
) -> Number:
    r"""Return the acceleration nearest to ``wanted`` that does not lead across a wall.

    .. math:: u = \mathrm{sat}(-u_{max}, \max(u_r, -u_s), u_{max})

    If gamma is less than u_max, no wanted acceleration leads across from a state inside the envelope.

    Source: Zheng et al., eq. 9, with the wall below alone. Walls in x and y at once can deadlock a unit: use
    one, aligned with the path.

    Args:
        wanted: u_r, any shape [m/s2].
        position: Distance from the wall, positive where it is safe, same shape [m].
        velocity: Rate of that distance, same shape [m/s].
        gains: Envelope.
        max_acceleration: u_max [m/s2].

    Returns:
        u, same shape [m/s2].
    """
    u = at_least(wanted, -safe_acceleration(-position, -velocity, gains))
    return limit(u, -max_acceleration, max_acceleration)
