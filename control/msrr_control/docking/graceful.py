"""Park and Kuipers' smooth law for reaching a pose, in common use for docking wheeled robots."""

from __future__ import annotations

import numpy as np

from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.kinematics.controlled_point import offset_point
from msrr_control.kinematics.drive_limits import limit_twist
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Length, NonNegative, Positive, Spec


class GracefulParams(Spec):
    """Parameters of :class:`GracefulLaw`.

    Attributes:
        k1: Ratio of the rates at which the angles to the target and the distance fall.
        k2: Ratio of the rate at which the heading is corrected to the rate of those angles.
        slow_down: beta, how much curvature slows the unit down.
        sharpness: lambda, how abruptly it does.
        ahead_m: Distance of the goal beyond the seat: at the goal itself the law is singular.
        guidance: Guidance trajectory, whose speed the unit takes on a straight line; a curve is taken slower.
    """

    k1: Positive = 2.0
    k2: Positive = 5.0
    slow_down: NonNegative = 0.1
    sharpness: Positive = 2.0
    ahead_m: Length = 0.08
    guidance: GuidanceSpec = GuidanceSpec()


class GracefulLaw:
    r"""Steers along a smooth curve into the port, without a cone and without tracking a point.

    .. math:: w = -\frac{v}{r}\left[k_2(\delta - \arctan(-k_1\theta))
        + \left(1 + \frac{k_1}{1 + (k_1\theta)^2}\right)\sin\delta\right],\quad
        v = \frac{v_r}{1 + \beta|\kappa|^\lambda}

    with the distance r to the goal, and the headings theta of the goal and delta of the unit against the line
    to it.

    Source: J. J. Park and B. Kuipers, "A smooth control law for graceful motion of differential wheeled
    mobile robots in 2D environment", ICRA 2011. The goal beyond the seat and the guidance's speed are
    additions.
    """

    def __init__(self, params: GracefulParams, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step."""
        self.params, self.setup = params, setup

    def start(self, inputs: LawInputs) -> GuidanceState:
        """Return the state at the beginning of an approach."""
        return guidance_start(offset_point(inputs.pose, self.setup.offset))

    def step(self, state: GuidanceState, inputs: LawInputs, dt: float) -> tuple[Array, GuidanceState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        params, setup, limits = self.params, self.setup, self.setup.limits
        tip = offset_point(inputs.pose, setup.offset)
        abreast = state._replace(x=np.minimum(tip[..., 0], state.x))
        guidance = guidance_step(abreast, tip, inputs.visibility, params.guidance, setup.pin_reach, dt)
        curvature = self.curvature(inputs.pose)
        speed = guidance.speed / (1.0 + params.slow_down * np.abs(curvature) ** params.sharpness)
        twist = np.empty(tip.shape)
        twist[..., 0] = speed
        twist[..., 1] = curvature * speed
        return limit_twist(twist, limits.v_close_mps, limits.w_max_radps), guidance

    def curvature(self, pose: Array) -> Array:
        """Return the curvature [1/m] of the path from a pose in D, shape (..., 3), to the goal."""
        k1, k2 = self.params.k1, self.params.k2
        goal_x = -self.setup.offset + self.params.ahead_m
        along, across = goal_x - pose[..., 0], -pose[..., 1]
        line = np.arctan2(across, along)
        distance = np.maximum(np.hypot(along, across), 0.5 * self.params.ahead_m)
        theta = -line
        delta = np.arctan2(np.sin(pose[..., 2] - line), np.cos(pose[..., 2] - line))
        slope = 1.0 + k1 / (1.0 + (k1 * theta) ** 2)
        curvature: Array = -(k2 * (delta - np.arctan(-k1 * theta)) + slope * np.sin(delta)) / distance
        return curvature

    def reference(self, state: GuidanceState) -> Array:
        """Return NaN, shape (..., 2): a point that keeps abreast of the estimate is no trajectory."""
        return np.full_like(state.point, np.nan)
