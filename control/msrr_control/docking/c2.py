"""The close-range law C2, with which the paper compares its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.docking.law import DockSetup, Sensed, limit_twist
from msrr_control.feedback.sliding import SlidingGains, sliding_feedback
from msrr_control.feedback.visibility_cone import ConeGains, ConeState, cone_force, cone_step
from msrr_control.kinematics.offset_point import offset_point, twist_for
from msrr_scenes.arrays import Array
from msrr_scenes.specs.spec import Spec

#: Errors beyond this [m] are cut: farther than any arena.
_FARTHEST = 100.0


class C2DockingParams(Spec):
    """Parameters of :class:`C2DockingLaw`.

    Attributes:
        feedback: Sliding feedback with a boundary layer.
        cone: Line-of-sight correction, the same as that of C1.
        guidance: The trajectory that is followed, the same as that of C1.
        los_correction: Use the line-of-sight correction.
    """

    feedback: SlidingGains = SlidingGains()
    cone: ConeGains = ConeGains()
    guidance: GuidanceSpec = GuidanceSpec()
    los_correction: bool = True


class C2DockingState(NamedTuple):
    """The reference on the docking axis, and the filters of the line-of-sight correction."""

    guidance: GuidanceState
    cone: ConeState


class C2DockingLaw:
    r"""Sliding tracking of the guidance, with the line-of-sight correction and without anti-windup.

    .. math:: e = p_l - (p_r + \lambda_1),\quad u = u_s(e) + \dot p_r + \dot\lambda_1

    Source: the comparison of Zheng et al. (their reference [22]): what it knows of the drive's limits is
    nothing.
    """

    def __init__(self, params: C2DockingParams, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step."""
        self.params = params
        self.setup = setup

    def start(self, sensed: Sensed) -> C2DockingState:
        """Return the state at the beginning of an approach: the reference beside the tip, at rest."""
        tip = offset_point(sensed.pose, self.setup.offset)
        nothing = np.zeros_like(tip)
        return C2DockingState(guidance_start(tip), ConeState(nothing, nothing))

    def step(self, state: C2DockingState, sensed: Sensed, dt: float) -> tuple[Array, C2DockingState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        params, setup = self.params, self.setup
        yaw = sensed.pose[..., 2]
        tip = offset_point(sensed.pose, setup.offset)
        guidance = guidance_step(state.guidance, tip, sensed.visibility, params.guidance, setup.pin_reach, dt)
        goal, pace = np.zeros_like(tip), np.zeros_like(tip)
        goal[..., 0], pace[..., 0] = guidance.x, guidance.speed
        cone = state.cone
        if params.los_correction:
            force = cone_force(sensed.edges, yaw, setup.los, params.cone.x_share)
            # A target that is lost pulls nowhere; its last angles are no measurement.
            force *= (sensed.visibility > 0.0)[..., None]
            cone, shift_rate = cone_step(cone, force, params.cone, dt)
            goal += cone.shift
            pace += shift_rate
        error = np.minimum(np.maximum(tip - goal, -_FARTHEST), _FARTHEST)
        wish = twist_for(sliding_feedback(error, params.feedback) + pace, yaw, setup.offset)
        return limit_twist(wish, setup.limits), C2DockingState(guidance, cone)

    def reference(self, state: C2DockingState) -> Array:
        """Return the guidance trajectory's point p_r in D, shape (..., 2) [m]."""
        return np.stack([state.guidance.x, np.zeros_like(state.guidance.x)], axis=-1)
