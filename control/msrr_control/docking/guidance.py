"""The reference that glides along the docking axis to the face, and waits for the unit when it has to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from msrr_control.kinematics.elementwise import Number, at_least, at_most, limit, number, split, sqrt
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import NonNegative, Positive, Spec


class GuidanceSpec(Spec):
    """The guidance trajectory p_r of the close-range phase.

    Attributes:
        speed_mps: Approach speed.
        ramp_s: Time from rest to that speed and back.
        contact_mps: Speed at which the pins reach the port.
        overrun_m: How far beyond the face the reference ends, so that the unit is pushed into the port.
        lag_m: Distance of the tip behind the reference at which the reference waits.
        corridor_m: Lateral error of the tip at the pins' contact up to which the reference goes on.
        corridor_slope: Growth of that lateral bound per metre of distance.
    """

    speed_mps: Positive = 0.11
    ramp_s: Positive = 0.6
    contact_mps: Positive = 0.06
    overrun_m: NonNegative = 0.01
    lag_m: Positive = 0.06
    corridor_m: Positive = 0.006
    corridor_slope: NonNegative = 0.25

    @property
    def acceleration(self) -> float:
        """Acceleration of the ramps [m/s2]."""
        return self.speed_mps / self.ramp_s


class GuidanceState(NamedTuple):
    """Place x_r on the docking axis [m] (y_r = 0) and its speed [m/s], each of shape (...)."""

    x: Array
    speed: Array


def guidance_start(tip: Array) -> GuidanceState:
    """Start at rest beside the tip, shape (..., 2) [m] in D: at the distance it has now, on the axis."""
    x = np.array(tip[..., 0])
    return GuidanceState(x, np.zeros_like(x))


def guidance_step(
    state: GuidanceState, tip: Array, visibility: Array, spec: GuidanceSpec, pin_reach: float, dt: float
) -> GuidanceState:
    """Advance the reference by ``dt``.

    The paper's trajectory (0.11 m/s with ramps of 0.6 s) as long as nothing is amiss. It waits when the tip
    lags, when the tip is too far off the axis to enter the port from here, and in the measure in which the
    target is not seen; it slows down to the contact speed before the pins touch.

    Source: Zheng et al., the guidance trajectory of the close-range phase; waiting is an addition.

    Args:
        state: Reference.
        tip: The controlled point in D, shape (..., 2) [m].
        visibility: 1 seen, 0 lost, between: predicted; shape (...).
        spec: Speeds and bounds.
        pin_reach: How far the pins stick out beyond the controlled point [m].
        dt: Step [s].

    Returns:
        The reference one step later.
    """
    a = spec.acceleration
    x, before = number(state.x), number(state.speed)
    tip_x, tip_y = split(tip)
    to_pins = at_least(-pin_reach - x, 0.0)
    to_end = at_least(spec.overrun_m - x, 0.0)
    wish = at_most(sqrt(spec.contact_mps**2 + 2.0 * a * to_pins), spec.speed_mps)
    wish = at_most(wish, sqrt(2.0 * a * to_end))
    corridor = spec.corridor_m + spec.corridor_slope * to_pins
    on_axis = _fades(abs(tip_y) / corridor)
    in_step = _fades(2.0 * (x - tip_x) / spec.lag_m)
    wish = wish * (number(visibility) * on_axis * in_step)
    speed = before + limit(wish - before, -a * dt, a * dt)
    return GuidanceState(np.asarray(at_most(x + dt * speed, spec.overrun_m)), np.asarray(speed))


def _fades(ratio: Number) -> Number:
    """Return 1 up to a ratio of 1, falling to 0 at a ratio of 2."""
    return limit(2.0 - ratio, 0.0, 1.0)
