"""Magnitude and rate limits of a drive."""

from __future__ import annotations

from collections.abc import Callable
from typing import overload

import numpy as np

from msrr_scenes.arrays import Array


@overload
def nested_limit(
    speed: float, wish: float, max_speed: float, max_rate: float, kappa: float, dt: float
) -> float: ...
@overload
def nested_limit(
    speed: Array, wish: Array, max_speed: float, max_rate: float, kappa: float, dt: float
) -> Array: ...
def nested_limit(
    speed: float | Array, wish: float | Array, max_speed: float, max_rate: float, kappa: float, dt: float
) -> float | Array:
    r"""Advance one speed behind its nested magnitude and rate limits by ``dt``.

    .. math:: \dot v_s = \mathrm{sat}(-a, \kappa(\mathrm{sat}(-V, v_d, V) - v_s), a)

    Source: Zheng et al., eq. 3; the loop gain is written out (printed kappa = 1 1/s never docks).

    Args:
        speed: Present speed v_s, any shape [m/s or rad/s].
        wish: Commanded speed v_d, same shape.
        max_speed: V > 0.
        max_rate: a > 0 [per second].
        kappa: Bandwidth of the inner loop [1/s]; ``kappa * dt`` above 1 counts as 1: no step overshoots.
        dt: Step [s].

    Returns:
        The speed one step later, same shape.
    """
    if isinstance(speed, float) and isinstance(wish, float):
        return follower(max_speed, max_rate, kappa, dt)(speed, wish)
    change_ = min(kappa * dt, 1.0) * (np.clip(wish, -max_speed, max_speed) - speed)
    return speed + np.clip(change_, -max_rate * dt, max_rate * dt)


def follower(max_speed: float, max_rate: float, kappa: float, dt: float) -> Callable[[float, float], float]:
    """Return :func:`nested_limit` of one drive and one step size, as a function of speed and wish."""
    share, most = min(kappa * dt, 1.0), max_rate * dt

    def follow(speed: float, wish: float) -> float:
        if wish > max_speed:
            wish = max_speed
        elif wish < -max_speed:
            wish = -max_speed
        change = share * (wish - speed)
        if change > most:
            return speed + most
        if change < -most:
            return speed - most
        return speed + change  # what is no number stays none

    return follow
