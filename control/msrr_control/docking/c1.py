"""The paper's close-range law: composite feedback, line-of-sight correction and anti-windup."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import model_validator

from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.docking.law import DockSetup, Sensed, limit_twist
from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.feedback.composite import CompositeGains, composite_feedback
from msrr_control.feedback.visibility_cone import ConeGains, ConeState, cone_force, cone_step
from msrr_control.kinematics.drive_limits import nested_limit
from msrr_control.kinematics.offset_point import offset_point, point_velocity, twist_for
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Positive, Spec

#: Errors beyond this [m] are cut: farther than any arena, and long before eq. 27's exponential overflows.
_FARTHEST = 100.0


class C1DockingParams(Spec):
    """Parameters of :class:`C1DockingLaw`; the three switches are ablations.

    Attributes:
        feedback: Composite feedback (eqs. 26, 27); ``feedback.nonlinear`` switches its second term.
        windup: Anti-windup system xi (eq. 25).
        cone: Line-of-sight correction (eqs. 21 to 24).
        guidance: The trajectory that is followed.
        los_correction: Use the line-of-sight correction.
        anti_windup: Use the anti-windup system.
    """

    feedback: CompositeGains = CompositeGains()
    windup: AuxiliaryGains = AuxiliaryGains(k_mps=0.05, gamma_m=0.10)
    cone: ConeGains = ConeGains()
    guidance: GuidanceSpec = GuidanceSpec()
    los_correction: bool = True
    anti_windup: bool = True

    @model_validator(mode="after")
    def _windup_below_loop(self) -> C1DockingParams:
        if self.anti_windup and self.windup.bandwidth >= self.feedback.k_n_per_s:
            raise ValueError(
                f"windup.k_mps / windup.gamma_m = {self.windup.bandwidth:.3g} 1/s has to stay below"
                f" feedback.k_n_per_s = {self.feedback.k_n_per_s:.3g} 1/s; else anti-windup is a limit cycle"
            )
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
        self.params = params
        self.setup = setup

    def start(self, sensed: Sensed) -> C1DockingState:
        """Return the state at the beginning of an approach: the reference beside the tip, at rest."""
        tip = offset_point(sensed.pose, self.setup.offset)
        nothing = np.zeros_like(tip)
        return C1DockingState(
            guidance=guidance_start(tip),
            cone=ConeState(nothing, nothing),
            xi=nothing,
            limited=limit_twist(np.asarray(sensed.twist, dtype=np.float64), self.setup.limits),
        )

    def step(self, state: C1DockingState, sensed: Sensed, dt: float) -> tuple[Array, C1DockingState]:
        r"""Advance the law by ``dt`` and return the command.

        .. math:: e = p_l - (p_r + \lambda_1) - \gamma\tanh\xi,\quad
            u = u_{27}(e) + \dot p_r + \dot\lambda_1 - k\xi

        Source: Zheng et al., eqs. 24 to 27.

        Args:
            state: State of the law.
            sensed: Pose, line of sight and twist, leading shape (...).
            dt: Control period [s].

        Returns:
            (v, w) within the drive's speed limits, shape (..., 2), and the next state.
        """
        params, setup = self.params, self.setup
        yaw = sensed.pose[..., 2]
        tip = offset_point(sensed.pose, setup.offset)
        guidance = guidance_step(state.guidance, tip, sensed.visibility, params.guidance, setup.pin_reach, dt)
        goal = np.zeros_like(tip)
        goal[..., 0] = guidance.x
        pace = np.zeros_like(tip)
        pace[..., 0] = guidance.speed

        cone = state.cone
        if params.los_correction:
            force = cone_force(sensed.edges, yaw, setup.los, params.cone.x_share)
            # A target that is lost pulls nowhere; its last angles are no measurement.
            force *= (sensed.visibility > 0.0)[..., None]
            cone, shift_rate = cone_step(cone, force, params.cone, dt)
            goal += cone.shift
            pace += shift_rate

        error = np.minimum(np.maximum(tip - goal, -_FARTHEST), _FARTHEST)
        if params.anti_windup:
            error -= params.windup.gamma_m * np.tanh(state.xi)
        velocity = composite_feedback(error, params.feedback) + pace
        if params.anti_windup:
            velocity -= params.windup.k_mps * state.xi
        wish = twist_for(velocity, yaw, setup.offset)
        limited = self._limited(state.limited, wish, dt)
        xi = state.xi
        if params.anti_windup:
            excess = point_velocity(limited - wish, yaw, setup.offset)
            xi = auxiliary_step(xi, excess, params.windup, dt)
        return limit_twist(wish, setup.limits), C1DockingState(guidance, cone, xi, limited)

    def reference(self, state: C1DockingState) -> Array:
        """Return the guidance trajectory's point p_r in D, shape (..., 2) [m]."""
        return np.stack([state.guidance.x, np.zeros_like(state.guidance.x)], axis=-1)

    def _limited(self, limited: Array, wish: Array, dt: float) -> Array:
        """Pass the wish through the drive's magnitude and rate limits, without its lag.

        With measured wheel speeds in place of this the law keeps 4.5 to 7.7 mm of final bias.
        """
        limits, no_lag = self.setup.limits, 1.0 / dt
        passed = np.empty(wish.shape)
        passed[..., 0] = nested_limit(
            limited[..., 0], wish[..., 0], limits.v_close_mps, limits.a_max_mps2, no_lag, dt
        )
        passed[..., 1] = nested_limit(
            limited[..., 1], wish[..., 1], limits.w_max_radps, limits.dw_max_radps2, no_lag, dt
        )
        return passed


class LinearParams(Spec):
    """Parameters of the plain linear law: the guidance and one gain."""

    k_n_per_s: Positive = 0.8
    guidance: GuidanceSpec = GuidanceSpec()

    def as_close_range(self) -> C1DockingParams:
        """Return the close-range law's parameters with everything but the linear term switched off."""
        return C1DockingParams(
            feedback=CompositeGains(k_n_per_s=self.k_n_per_s, nonlinear=False),
            guidance=self.guidance,
            los_correction=False,
            anti_windup=False,
        )
