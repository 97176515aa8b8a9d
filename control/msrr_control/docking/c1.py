"""The paper's close-range law C1: composite feedback, line-of-sight correction and anti-windup."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import model_validator

from msrr_control.docking.guidance import (
    CorrectedGuidanceParams,
    GuidanceSpec,
    GuidanceState,
    corrected_guidance,
    guidance_start,
)
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.feedback.composite import CompositeGains, composite_feedback
from msrr_control.feedback.visibility_cone import ConeState
from msrr_control.kinematics.controlled_point import offset_point, point_velocity, position_error, twist_for
from msrr_control.kinematics.drive_limits import limit_twist, nested_limit_twist
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Gain, Spec


class C1DockingParams(CorrectedGuidanceParams):
    """Parameters of :class:`C1DockingLaw`; the two switches and ``feedback.nonlinear`` are ablations.

    Attributes:
        feedback: Composite feedback (eqs. 26, 27).
        windup: Anti-windup system xi (eq. 25).
        anti_windup: Whether the anti-windup system is used.
    """

    feedback: CompositeGains = CompositeGains()
    windup: AuxiliaryGains = AuxiliaryGains(k_mps=0.05, gamma_m=0.10)
    anti_windup: bool = True

    @model_validator(mode="after")
    def _windup_below_loop(self) -> C1DockingParams:
        if self.anti_windup:
            self.windup.check_below(self.feedback.k_n_per_s, "feedback.k_n_per_s")
        return self


class C1DockingState(NamedTuple):
    """State of the law; all arrays share the leading shape of the trials.

    Attributes:
        guidance: Reference on the docking axis.
        cone: Filters of the line-of-sight correction.
        xi: Anti-windup state, shape (..., 2).
        limited: (v_s, w_s) behind the law's own magnitude and rate limiter, which has no lag, shape (..., 2).
    """

    guidance: GuidanceState
    cone: ConeState
    xi: Array
    limited: Array


class C1DockingLaw:
    """The close-range law C1 (Zheng et al., eqs. 21 to 29) in its corrected form."""

    def __init__(self, params: C1DockingParams, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step."""
        self.params, self.setup = params, setup

    def start(self, inputs: LawInputs) -> C1DockingState:
        """Return the state at the beginning of an approach, the reference abreast of the controlled point."""
        limits = self.setup.limits
        twist = np.asarray(inputs.twist, dtype=np.float64)
        tip = offset_point(inputs.pose, self.setup.offset)
        zero = np.zeros_like(tip)
        limited = limit_twist(twist, limits.v_close_mps, limits.w_max_radps)
        return C1DockingState(guidance_start(tip), ConeState(zero, zero), zero, limited)

    def step(self, state: C1DockingState, inputs: LawInputs, dt: float) -> tuple[Array, C1DockingState]:
        r"""Advance the law by ``dt`` and return the command.

        .. math:: e = p_l - (p_r + \lambda_1) - \gamma\tanh\xi,\quad
            u = u_{27}(e) + \dot p_r + \dot\lambda_1 - k\xi

        The saturation that drives xi is that of the drive's magnitude and rate limits without its lag. With
        measured wheel speeds in its place the law keeps 4.5 to 7.7 mm of final bias.

        Source: Zheng et al., eqs. 24 to 27.
        """
        params, setup, limits = self.params, self.setup, self.setup.limits
        yaw = inputs.pose[..., 2]
        tip = offset_point(inputs.pose, setup.offset)
        target = corrected_guidance(state.guidance, state.cone, tip, inputs, params, setup, dt)
        error = position_error(tip, target.position)
        if params.anti_windup:
            error -= params.windup.gamma_m * np.tanh(state.xi)
        velocity = composite_feedback(error, params.feedback) + target.velocity
        if params.anti_windup:
            velocity -= params.windup.k_mps * state.xi
        twist = twist_for(velocity, yaw, setup.offset)
        limited = nested_limit_twist(state.limited, twist, limits, 1.0 / dt, dt, limits.v_close_mps)
        xi = state.xi
        if params.anti_windup:
            excess = point_velocity(limited - twist, yaw, setup.offset)
            xi = auxiliary_step(xi, excess, params.windup, dt)
        command = limit_twist(twist, limits.v_close_mps, limits.w_max_radps)
        return command, C1DockingState(target.guidance, target.cone, xi, limited)

    def reference(self, state: C1DockingState) -> Array:
        """Return the guidance trajectory's point p_r in D, shape (..., 2) [m]."""
        return state.guidance.point


class LinearParams(Spec):
    """Parameters of the plain linear law: the guidance and one gain.

    Attributes:
        k_n_per_s: Gain of the linear tracking.
        guidance: Guidance trajectory.
    """

    k_n_per_s: Gain = 0.8
    guidance: GuidanceSpec = GuidanceSpec()

    def as_c1(self) -> C1DockingParams:
        """Return the parameters of C1 with everything but the linear term switched off."""
        return C1DockingParams(
            feedback=CompositeGains(k_n_per_s=self.k_n_per_s, nonlinear=False),
            guidance=self.guidance,
            los_correction=False,
            anti_windup=False,
        )
