"""The close-range law C2: our reading of the law with which the paper compares C1.

The paper prints no equations of it; it describes it in words and names a source.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import model_validator

from msrr_control.docking.guidance import (
    CorrectedGuidanceParams,
    GuidanceState,
    corrected_guidance,
    guidance_start,
)
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.feedback.sliding import SlidingGains, sliding_feedback
from msrr_control.feedback.visibility_cone import ConeState
from msrr_control.kinematics.controlled_point import offset_point, point_velocity, position_error, twist_for
from msrr_control.kinematics.drive_limits import limit_twist, nested_limit_twist
from msrr_scenes.arrays import Array


class C2DockingParams(CorrectedGuidanceParams):
    """Parameters of :class:`C2DockingLaw`.

    Attributes:
        feedback: Sliding feedback with a boundary layer.
        windup: Anti-windup system of C1, which C2 does not use.
        anti_windup: Whether it is used all the same, to show how much of the contrast is due to it.
    """

    feedback: SlidingGains = SlidingGains()
    windup: AuxiliaryGains = AuxiliaryGains(k_mps=0.05, gamma_m=0.10)
    anti_windup: bool = False

    @model_validator(mode="after")
    def _windup_below_loop(self) -> C2DockingParams:
        if self.anti_windup:
            self.windup.check_below(self.feedback.k_per_s, "feedback.k_per_s")
        return self


class C2DockingState(NamedTuple):
    """State of the law; the parts are those of :class:`msrr_control.docking.c1.C1DockingState`."""

    guidance: GuidanceState
    cone: ConeState
    xi: Array
    limited: Array


class C2DockingLaw:
    r"""Tracks the reference of C1 by sliding feedback, without anti-windup.

    .. math:: e = p_l - (p_r + \lambda_1),\quad u = u_s(e) + \dot p_r + \dot\lambda_1

    Source: our reading of the comparison of Zheng et al. (their reference [22]), whose equations they do not
    print; it takes no account of the drive's limits.
    """

    def __init__(self, params: C2DockingParams, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step."""
        self.params, self.setup = params, setup

    def start(self, inputs: LawInputs) -> C2DockingState:
        """Return the state at the beginning of an approach, the reference abreast of the controlled point."""
        tip = offset_point(inputs.pose, self.setup.offset)
        zero = np.zeros_like(tip)
        limits = self.setup.limits
        twist = np.asarray(inputs.twist, dtype=np.float64)
        limited = limit_twist(twist, limits.v_close_mps, limits.w_max_radps)
        return C2DockingState(guidance_start(tip), ConeState(zero, zero), zero, limited)

    def step(self, state: C2DockingState, inputs: LawInputs, dt: float) -> tuple[Array, C2DockingState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        params, setup, limits = self.params, self.setup, self.setup.limits
        yaw = inputs.pose[..., 2]
        tip = offset_point(inputs.pose, setup.offset)
        target = corrected_guidance(state.guidance, state.cone, tip, inputs, params, setup, dt)
        error = position_error(tip, target.position)
        if params.anti_windup:
            error -= params.windup.gamma_m * np.tanh(state.xi)
        velocity = sliding_feedback(error, params.feedback) + target.velocity
        if params.anti_windup:
            velocity -= params.windup.k_mps * state.xi
        twist = twist_for(velocity, yaw, setup.offset)
        limited, xi = state.limited, state.xi
        if params.anti_windup:
            limited = nested_limit_twist(limited, twist, limits, 1.0 / dt, dt, limits.v_close_mps)
            xi = auxiliary_step(xi, point_velocity(limited - twist, yaw, setup.offset), params.windup, dt)
        command = limit_twist(twist, limits.v_close_mps, limits.w_max_radps)
        return command, C2DockingState(target.guidance, target.cone, xi, limited)

    def reference(self, state: C2DockingState) -> Array:
        """Return the guidance trajectory's point p_r in D, shape (..., 2) [m]."""
        return state.guidance.point
