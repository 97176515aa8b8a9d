"""The law ``cbf``: linear tracking with a barrier, the safety envelope, on the two line-of-sight angles."""

from __future__ import annotations

import math

from pydantic import Field

from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.feedback.envelope import EnvelopeGains, envelope
from msrr_control.kinematics.controlled_point import offset_point, position_error, rotate_components
from msrr_control.kinematics.elementwise import (
    Number,
    at_least,
    cos,
    hypot,
    join,
    limit,
    number,
    sin,
    split,
    where,
)
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.specs.spec import NonNegative, Positive, Spec


class BarrierParams(Spec):
    """Parameters of :class:`BarrierLaw`.

    Attributes:
        k_n_per_s: Gain of the linear tracking.
        braking: Share of the drive's angular acceleration that the envelope counts on.
        rho_rad: Angle over which the envelope rounds off.
        margin_deg: Angle by which the barrier lies inside the outer cone.
        guidance: Guidance trajectory.
    """

    k_n_per_s: Positive = 2.0
    braking: float = Field(default=0.6, gt=0.0, lt=1.0)
    rho_rad: Positive = 0.05
    margin_deg: NonNegative = math.degrees(0.05)
    guidance: GuidanceSpec = GuidanceSpec()


class BarrierLaw:
    r"""Tracks the guidance linearly, with the turn rate bounded so that the target stays in view.

    The rate of an edge angle is :math:`\dot a = v\sin a/r - w(1 + l_c\cos a/r)`. The envelope of Lemma 1
    (Zheng et al., eqs. 4 to 6) bounds it on either side, and that bounds w in closed form. The law is not in
    the paper; it needs no force, no filter and no quadratic program.
    """

    def __init__(self, params: BarrierParams, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step.

        Raises:
            SceneError: The margin leaves nothing of the cone.
        """
        self.params, self.setup = params, setup
        self._limit = setup.los.outer - math.radians(params.margin_deg)
        if self._limit <= 0.0:
            raise SceneError(f"margin_deg = {params.margin_deg:g} leaves nothing of los.outer_deg")
        self._gains = EnvelopeGains(gamma=params.braking * setup.limits.dw_max_radps2, rho=params.rho_rad)

    def start(self, inputs: LawInputs) -> GuidanceState:
        """Return the state at the beginning of an approach."""
        return guidance_start(offset_point(inputs.pose, self.setup.offset))

    def step(self, state: GuidanceState, inputs: LawInputs, dt: float) -> tuple[Array, GuidanceState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        params, setup, limits = self.params, self.setup, self.setup.limits
        visibility = number(inputs.visibility)
        x, y, yaw = split(inputs.pose)
        tip = join(x + setup.offset * cos(yaw), y + setup.offset * sin(yaw))
        guidance = guidance_step(state, tip, visibility, params.guidance, setup.pin_reach, dt)
        tip_x, tip_y = split(tip)
        velocity_x = -params.k_n_per_s * position_error(tip_x, number(guidance.x)) + number(guidance.speed)
        velocity_y = -params.k_n_per_s * position_error(tip_y, 0.0)
        v, across = rotate_components(velocity_x, velocity_y, -yaw)
        v = limit(v, -limits.v_close_mps, limits.v_close_mps)
        w = limit(across / setup.offset, -limits.w_max_radps, limits.w_max_radps)
        low, high = self.turn_bounds(v, inputs)
        w_in_view = where(low > high, 0.5 * low + 0.5 * high, limit(w, low, high))
        w = limit(where(visibility > 0.0, w_in_view, w), -limits.w_max_radps, limits.w_max_radps)
        return join(v, w), guidance

    def turn_bounds(self, v: Number, inputs: LawInputs) -> tuple[Number, Number]:
        """Return the lowest and highest turn rate [rad/s] that keep both edges in the cone (may cross)."""
        los, camera_offset = self.setup.los, self.setup.camera_offset
        x, y, yaw = split(inputs.pose)
        camera_x, camera_y = x + camera_offset * cos(yaw), y + camera_offset * sin(yaw)
        bounds = []
        left, right = split(inputs.edges)
        for angle, sign in ((left, 1.0), (right, -1.0)):
            b = sign * los.half_width_m
            distance = at_least(hypot(los.setback_m - camera_x, b - camera_y), los.half_width_m)
            allowed = sign * envelope(sign * angle - self._limit, self._gains)
            lever = 1.0 + camera_offset * cos(angle) / distance
            bounds.append((v * sin(angle) / distance - allowed) / lever)
        return bounds[0], bounds[1]

    def reference(self, state: GuidanceState) -> Array:
        """Return the guidance trajectory's point p_r in D, shape (..., 2) [m]."""
        return state.point
