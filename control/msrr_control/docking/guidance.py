"""The reference that a docking law tracks: the guidance trajectory along the docking axis."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from msrr_control.kinematics.elementwise import Number, at_least, at_most, limit, number, split, sqrt
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Distance, Duration, Length, NonNegative, Spec, Speed


class GuidanceSpec(Spec):
    """The guidance trajectory p_r of the close-range phase.

    Attributes:
        speed_mps: Approach speed.
        ramp_s: Time from rest to that speed and back.
        contact_mps: Speed at which the pins reach the port.
        overrun_m: Distance beyond the face at which the reference ends, so that the unit is pushed into the
            port.
        lag_m: Distance of the controlled point behind the reference at which the reference waits; it slows
            down from half of this on.
        corridor_m: Lateral error of the controlled point at the pins' contact up to which the reference goes
            on.
        corridor_slope: Growth of that lateral bound per metre of distance.
    """

    speed_mps: Speed = 0.11
    ramp_s: Duration = 0.6
    contact_mps: Speed = 0.06
    overrun_m: Distance = 0.01
    lag_m: Length = 0.06
    corridor_m: Length = 0.006
    corridor_slope: NonNegative = 0.25

    @property
    def acceleration(self) -> float:
        """Acceleration of the ramps [m/s2]."""
        return self.speed_mps / self.ramp_s


class GuidanceState(NamedTuple):
    """Place x_r on the docking axis [m] (y_r = 0) and its speed [m/s], floats or of shape (...)."""

    x: Any
    speed: Any

    @property
    def point(self) -> Array:
        """The reference p_r in D, shape (..., 2) [m]."""
        return np.stack([self.x, np.zeros_like(self.x)], axis=-1)


def guidance_start(tip: Array) -> GuidanceState:
    """Return a reference at rest on the axis abreast of the controlled point, shape (..., 2) [m] in D."""
    x = np.array(tip[..., 0])
    return GuidanceState(x, np.zeros_like(x))


def guidance_step(
    state: GuidanceState, tip: Array, visibility: Array, spec: GuidanceSpec, pin_reach: float, dt: float
) -> GuidanceState:
    """Advance the reference by ``dt``.

    An unhindered approach is the paper's trajectory (0.11 m/s with ramps of 0.6 s), slowed down to the
    contact speed before the pins touch. The reference slows down or waits while the controlled point lags, is
    too far off the axis to enter the port from here, or does not see the target.

    Source: Zheng et al., the guidance trajectory of the close-range phase; waiting is an addition.

    Args:
        state: Reference.
        tip: Controlled point in D, shape (..., 2) [m].
        visibility: 1 where the target is seen, 0 where lost, between where predicted; shape (...).
        spec: Speeds and bounds.
        pin_reach: Distance by which the pins stick out beyond the controlled point [m].
        dt: Step [s].
    """
    a = spec.acceleration
    x, speed = number(state.x), number(state.speed)
    tip_x, tip_y = split(tip)
    to_pins = at_least(-pin_reach - x, 0.0)
    to_end = at_least(spec.overrun_m - x, 0.0)
    wanted = at_most(sqrt(spec.contact_mps**2 + 2.0 * a * to_pins), spec.speed_mps)
    wanted = at_most(wanted, sqrt(2.0 * a * to_end))
    corridor = spec.corridor_m + spec.corridor_slope * to_pins
    on_axis = _fade(abs(tip_y) / corridor)
    in_step = _fade(2.0 * (x - tip_x) / spec.lag_m)
    wanted = wanted * (number(visibility) * on_axis * in_step)
    speed = speed + limit(wanted - speed, -a * dt, a * dt)
    return GuidanceState(at_most(x + dt * speed, spec.overrun_m), speed)


def _fade(ratio: Number) -> Number:
    """Return 1 up to a ratio of 1, falling to 0 at a ratio of 2."""
    return limit(2.0 - ratio, 0.0, 1.0)
