"""What the laws C1 and C2 have in common: all but the feedback on the error."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.feedback.auxiliary import AuxiliaryGains, auxiliary_step
from msrr_control.feedback.visibility_cone import ConeGains, ConeState, cone_force, cone_step
from msrr_control.kinematics.controlled_point import offset_point, point_velocity, position_error, twist_for
from msrr_control.kinematics.drive_limits import limit_twist, nested_limit_twist
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Spec


class CorrectedLawParams(Spec):
    """Parameters of a :class:`CorrectedLaw`.

    Attributes:
        cone: Line-of-sight correction (eqs. 21 to 24).
        guidance: Guidance trajectory.
        los_correction: Whether the line-of-sight correction is used (False is an ablation).
        windup: Anti-windup system xi (eq. 25).
        anti_windup: Whether the anti-windup system is used.
    """

    cone: ConeGains = ConeGains()
    guidance: GuidanceSpec = GuidanceSpec()
    los_correction: bool = True
    windup: AuxiliaryGains = AuxiliaryGains(k_mps=0.05, gamma_m=0.10)
    anti_windup: bool = True


Params = TypeVar("Params", bound=CorrectedLawParams)


class CorrectedLawState(NamedTuple):
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


class CorrectedLaw(ABC, Generic[Params]):
    """A close-range law that tracks the corrected guidance, with or without anti-windup."""

    def __init__(self, params: Params, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step."""
        self.params, self.setup = params, setup

    @abstractmethod
    def feedback(self, error: Array) -> Array:
        """Return the velocity against an error of the controlled point, shapes (..., 2) [m/s, m]."""

    def start(self, inputs: LawInputs) -> CorrectedLawState:
        """Return the state at the beginning of an approach, the reference abreast of the controlled point."""
        limits = self.setup.limits
        twist = np.asarray(inputs.twist, dtype=np.float64)
        tip = offset_point(inputs.pose, self.setup.offset)
        zero = np.zeros_like(tip)
        limited = limit_twist(twist, limits.v_close_mps, limits.w_max_radps)
        return CorrectedLawState(guidance_start(tip), ConeState(zero, zero), zero, limited)

    def step(self, state: CorrectedLawState, inputs: LawInputs, dt: float) -> tuple[Array, CorrectedLawState]:
        r"""Advance the law by ``dt`` and return the command.

        .. math:: e = p_l - (p_r + \lambda_1) - \gamma\tanh\xi,\quad
            u = u_f(e) + \dot p_r + \dot\lambda_1 - k\xi

        Here u_f is :meth:`feedback`. Without anti-windup the terms with xi are left out.

        The saturation that drives xi is that of the drive's magnitude and rate limits without its lag. With
        measured wheel speeds in its place the law keeps 4.5 to 7.7 mm of final bias.

        Source: Zheng et al., eqs. 21 to 27.
        """
        params, setup, limits = self.params, self.setup, self.setup.limits
        yaw = inputs.pose[..., 2]
        tip = offset_point(inputs.pose, setup.offset)
        guidance = guidance_step(state.guidance, tip, inputs.visibility, params.guidance, setup.pin_reach, dt)
        target, rate = np.zeros_like(tip), np.zeros_like(tip)
        target[..., 0], rate[..., 0] = guidance.x, guidance.speed
        cone = state.cone
        if params.los_correction:
            force = cone_force(inputs.edges, yaw, setup.los, params.cone.x_share)
            # The last angles of a lost target are no measurement: it exerts no force.
            force *= (inputs.visibility > 0.0)[..., None]
            cone, shift_rate = cone_step(cone, force, params.cone, dt)
            target += cone.shift
            rate += shift_rate
        error = position_error(tip, target)
        if params.anti_windup:
            error -= params.windup.gamma_m * np.tanh(state.xi)
        velocity = self.feedback(error) + rate
        if params.anti_windup:
            velocity -= params.windup.k_mps * state.xi
        twist = twist_for(velocity, yaw, setup.offset)
        limited, xi = state.limited, state.xi
        if params.anti_windup:
            limited = nested_limit_twist(limited, twist, limits, 1.0 / dt, dt, limits.v_close_mps)
            xi = auxiliary_step(xi, point_velocity(limited - twist, yaw, setup.offset), params.windup, dt)
        command = limit_twist(twist, limits.v_close_mps, limits.w_max_radps)
        return command, CorrectedLawState(guidance, cone, xi, limited)

    def reference(self, state: CorrectedLawState) -> Array:
        """Return the guidance trajectory's point p_r in D, shape (..., 2) [m]."""
        return state.guidance.point
