"""The close-range law C2, with which the paper compares C1."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from msrr_control.docking.guidance import (
    CorrectedGuidanceParams,
    GuidanceState,
    corrected_guidance,
    guidance_start,
)
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.feedback.sliding import SlidingGains, sliding_feedback
from msrr_control.feedback.visibility_cone import ConeState
from msrr_control.kinematics.controlled_point import offset_point, position_error, twist_for
from msrr_control.kinematics.drive_limits import limit_twist
from msrr_scenes.arrays import Array


class C2DockingParams(CorrectedGuidanceParams):
    """Parameters of :class:`C2DockingLaw`.

    Attributes:
        feedback: Sliding feedback with a boundary layer.
    """

    feedback: SlidingGains = SlidingGains()


class C2DockingState(NamedTuple):
    """The reference on the docking axis, and the filters of the line-of-sight correction."""

    guidance: GuidanceState
    cone: ConeState


class C2DockingLaw:
    r"""Tracks the reference of C1 by sliding feedback, without anti-windup.

    .. math:: e = p_l - (p_r + \lambda_1),\quad u = u_s(e) + \dot p_r + \dot\lambda_1

    Source: the comparison of Zheng et al. (their reference [22]); it takes no account of the drive's limits.
    """

    def __init__(self, params: C2DockingParams, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step."""
        self.params, self.setup = params, setup

    def start(self, inputs: LawInputs) -> C2DockingState:
        """Return the state at the beginning of an approach, the reference abreast of the controlled point."""
        tip = offset_point(inputs.pose, self.setup.offset)
        zero = np.zeros_like(tip)
        return C2DockingState(guidance_start(tip), ConeState(zero, zero))

    def step(self, state: C2DockingState, inputs: LawInputs, dt: float) -> tuple[Array, C2DockingState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        setup, limits = self.setup, self.setup.limits
        tip = offset_point(inputs.pose, setup.offset)
        target = corrected_guidance(state.guidance, state.cone, tip, inputs, self.params, setup, dt)
        error = position_error(tip, target.position)
        velocity = sliding_feedback(error, self.params.feedback) + target.velocity
        twist = twist_for(velocity, inputs.pose[..., 2], setup.offset)
        command = limit_twist(twist, limits.v_close_mps, limits.w_max_radps)
        return command, C2DockingState(target.guidance, target.cone)

    def reference(self, state: C2DockingState) -> Array:
        """Return the guidance trajectory's point p_r in D, shape (..., 2) [m]."""
        return state.guidance.point
