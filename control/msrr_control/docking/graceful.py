"""Park and Kuipers' smooth law for reaching a pose, the one in common use for docking wheeled robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.docking.law import DockSetup, Sensed, limit_twist
from msrr_control.kinematics.offset_point import offset_point
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import NonNegative, Positive, Spec


class GracefulParams(Spec):
    """Parameters of :class:`GracefulLaw`.

    Attributes:
        k1: Ratio of the rates at which the angles to the target and the distance fall.
        k2: How much faster the heading is corrected than that.
        slow_down: beta, how much curvature slows the unit down.
        sharpness: lambda, how abruptly.
        ahead_m: The goal lies this far beyond the seat: at the goal itself the law is singular.
        guidance: Speeds along the way; a curve is taken slower.
    """

    k1: Positive = 2.0
    k2: Positive = 5.0
    slow_down: NonNegative = 0.1
    sharpness: Positive = 2.0
    ahead_m: Positive = 0.08
    guidance: GuidanceSpec = GuidanceSpec()


class GracefulState(NamedTuple):
    """The pace keeper: a reference that glides along the axis abreast of the tip."""

    guidance: GuidanceState


class GracefulLaw:
    r"""Steers along a smooth curve into the port; no cone, no tracking of a point.

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
        self.params = params
        self.setup = setup

    def start(self, sensed: Sensed) -> GracefulState:
        """Return the state at the beginning of an approach."""
        return GracefulState(guidance_start(offset_point(sensed.pose, self.setup.offset)))

    def step(self, state: GracefulState, sensed: Sensed, dt: float) -> tuple[Array, GracefulState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        params, setup = self.params, self.setup
        tip = offset_point(sensed.pose, setup.offset)
        here = GuidanceState(np.minimum(tip[..., 0], state.guidance.x), state.guidance.speed)
        guidance = guidance_step(here, tip, sensed.visibility, params.guidance, setup.pin_reach, dt)
        curvature = self.curvature(sensed.pose)
        speed = guidance.speed / (1.0 + params.slow_down * np.abs(curvature) ** params.sharpness)
        twist = np.empty(tip.shape)
        twist[..., 0] = speed
        twist[..., 1] = curvature * speed
        return limit_twist(twist, setup.limits), GracefulState(guidance)

    def curvature(self, pose: Array) -> Array:
        """Return the curvature [1/m] of the path from a pose in D, shape (..., 3), to the goal."""
        k1, k2 = self.params.k1, self.params.k2
        goal_x = -self.setup.offset + self.params.ahead_m
        along, across = goal_x - pose[..., 0], -pose[..., 1]
        line = np.arctan2(across, along)
        distance = np.maximum(np.hypot(along, across), 0.5 * self.params.ahead_m)
        theta = -line
        delta = np.arctan2(np.sin(pose[..., 2] - line), np.cos(pose[..., 2] - line))
        bracket = k2 * (delta - np.arctan(-k1 * theta)) + (1.0 + k1 / (1.0 + (k1 * theta) ** 2)) * np.sin(
            delta
        )
        bent: Array = -bracket / distance
        return bent

    def reference(self, state: GracefulState) -> Array:
        """Return the point of the docking axis abreast of the tip, shape (..., 2) [m]."""
        return np.stack([state.guidance.x, np.zeros_like(state.guidance.x)], axis=-1)
