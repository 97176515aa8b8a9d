"""The retreat: backing out of the port along its axis, with the controlled point behind the axle."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from msrr_control.docking.law import DockSetup
from msrr_control.kinematics.controlled_point import offset_point, twist_for
from msrr_control.kinematics.drive_limits import limit_twist
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Acceleration, Gain, Length, Spec, Speed


class RetreatSpec(Spec):
    """How a unit backs out of the port.

    Attributes:
        speed_mps: Speed backwards.
        k_per_s: Gain on the distance of the rear point from the axis.
        slant: Largest sideways speed as a share of the speed backwards; it bounds the heading, and so keeps
            the marker in view.
        stop_mps2: Deceleration before the end.
        clear_m: Distance beyond the pins' length over which the unit backs out without steering.
    """

    speed_mps: Speed = 0.12
    k_per_s: Gain = 1.0
    slant: float = Field(default=0.3, gt=0.0, le=1.0)
    stop_mps2: Acceleration = 0.2
    clear_m: Length = 0.008


def retreat_twist(pose: Array, distance: float, spec: RetreatSpec, setup: DockSetup) -> Array:
    r"""Return the command that backs the unit out along the docking axis.

    The rear point, -l from the axle, is led along the axis. Backwards, leading the point ahead of the axle
    would be unstable (1 deg of heading grows to 41 deg in 0.4 m); the rear point behaves as the front one
    does forwards.

    Source: Zheng et al., eqs. 1 and 2 with l replaced by -l.

    Args:
        pose: Axle pose in D, shape (..., 3).
        distance: Gap between the faces at which to stop [m].
        spec: Speed and gains.
        setup: Facts of the docking step.

    Returns:
        (v, w), shape (..., 2); v is zero once the gap is reached.
    """
    gap = -offset_point(pose, setup.offset)[..., 0]
    rear = offset_point(pose, -setup.offset)
    remaining = np.maximum(distance - gap, 0.0)
    speed = np.minimum(spec.speed_mps, np.sqrt(2.0 * spec.stop_mps2 * remaining))
    max_sideways = spec.slant * speed
    velocity = np.empty(rear.shape)
    velocity[..., 0] = -speed
    velocity[..., 1] = np.minimum(np.maximum(-spec.k_per_s * rear[..., 1], -max_sideways), max_sideways)
    twist = twist_for(velocity, pose[..., 2], -setup.offset)
    in_holes = gap < setup.pin_reach + spec.clear_m
    twist[..., 0] = np.where(in_holes, -speed, twist[..., 0])
    twist[..., 1] = np.where(in_holes, 0.0, twist[..., 1])
    return limit_twist(twist, setup.limits.v_close_mps, setup.limits.w_max_radps)
