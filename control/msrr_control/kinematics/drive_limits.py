"""Magnitude and rate limits of a drive."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from msrr_control.kinematics.elementwise import Number, join, limit, split
from msrr_scenes.arrays import Array
from msrr_scenes.specs.vehicle import LimitsSpec


def nested_limit(
    speed: Number, command: Number, max_speed: float, max_rate: float, kappa: float, dt: float
) -> Number:
    r"""Advance one speed behind its nested magnitude and rate limits by ``dt``.

    .. math:: \dot v_s = \mathrm{sat}(-a, \kappa(\mathrm{sat}(-V, v_d, V) - v_s), a)

    Source: Zheng et al., eq. 3; the loop gain is written out (printed kappa = 1 1/s never docks).

    Args:
        speed: Present speed v_s, any shape [m/s or rad/s].
        command: Commanded speed v_d, same shape.
        max_speed: V > 0.
        max_rate: a > 0 [per second].
        kappa: Bandwidth of the inner loop [1/s]; ``kappa * dt`` above 1 counts as 1: no step overshoots.
        dt: Step [s].

    Returns:
        The speed one step later, same shape.
    """
    change = min(kappa * dt, 1.0) * (limit(command, -max_speed, max_speed) - speed)
    return speed + limit(change, -max_rate * dt, max_rate * dt)


def nested_limiter(
    max_speed: float, max_rate: float, kappa: float, dt: float
) -> Callable[[float, float], float]:
    """Return :func:`nested_limit` as a function of speed and command, fast for many calls on floats."""
    share, max_change = min(kappa * dt, 1.0), max_rate * dt

    def limited(speed: float, command: float) -> float:
        if command > max_speed:
            command = max_speed
        elif command < -max_speed:
            command = -max_speed
        change = share * (command - speed)
        if change > max_change:
            return speed + max_change
        if change < -max_change:
            return speed - max_change
        return speed + change  # NaN passes both comparisons and stays NaN

    return limited


def nested_limit_twist(
    twist: Array, command: Array, limits: LimitsSpec, kappa: float, dt: float, max_v: float | None = None
) -> Array:
    """Advance the speeds (v, w) of a unit, shape (..., 2), behind their nested limits (eq. 3) by ``dt`` [s].

    The limits are those of the drive, or ``max_v`` [m/s] for v; ``kappa`` = 1 / dt is a limiter without lag.
    """
    v_max = limits.v_max_mps if max_v is None else max_v
    limited = np.empty(command.shape)
    limited[..., 0] = nested_limit(twist[..., 0], command[..., 0], v_max, limits.a_max_mps2, kappa, dt)
    limited[..., 1] = nested_limit(
        twist[..., 1], command[..., 1], limits.w_max_radps, limits.dw_max_radps2, kappa, dt
    )
    return limited


def limit_twist(twist: Array, max_v: float, max_w: float) -> Array:
    """Return twists, shape (..., 2), with |v| limited to ``max_v`` [m/s] and |w| to ``max_w`` [rad/s]."""
    v, w = split(twist)
    return join(limit(v, -max_v, max_v), limit(w, -max_w, max_w))
