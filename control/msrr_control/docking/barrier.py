"""Linear tracking with a line-of-sight barrier: the safety envelope on the two edge angles."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pydantic import Field

from msrr_control.docking.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.docking.law import DockSetup, Sensed
from msrr_control.feedback.envelope import EnvelopeGains, envelope
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
from msrr_control.kinematics.offset_point import offset_point, rotated
from msrr_scenes.arrays import Array
from msrr_scenes.errors import SceneError
from msrr_scenes.specs.spec import NonNegative, Positive, Spec

_FARTHEST = 100.0


class BarrierParams(Spec):
    """Parameters of :class:`BarrierLaw`.

    Attributes:
        k_n_per_s: Gain of the linear tracking.
        braking: Share of the drive's angular acceleration that the envelope counts on.
        rho_rad: Angle over which the envelope rounds off.
        margin_deg: How far inside the outer cone the barrier stands.
        guidance: The trajectory that is followed.
    """

    k_n_per_s: Positive = 2.0
    braking: float = Field(default=0.6, gt=0.0, lt=1.0)
    rho_rad: Positive = 0.05
    margin_deg: NonNegative = math.degrees(0.05)
    guidance: GuidanceSpec = GuidanceSpec()


class BarrierState(NamedTuple):
    """The reference on the docking axis is all the law remembers."""

    guidance: GuidanceState


class BarrierLaw:
    r"""Tracks the guidance and turns no faster than the target can stay in view.

    The rate of an edge angle is :math:`\dot a = v\sin a/r - w(1 + l_c\cos a/r)`. The envelope of Lemma 1
    (Zheng et al., eqs. 4 to 6) bounds it on either side, and that bounds w in closed form. Beyond the paper:
    no force, no filter, no quadratic program.
    """

    def __init__(self, params: BarrierParams, setup: DockSetup) -> None:
        """Bind the law to its parameters and to the facts of the docking step.

        Raises:
            SceneError: The margin leaves nothing of the cone.
        """
        self.params = params
        self.setup = setup
        self._limit = setup.los.outer - math.radians(params.margin_deg)
        if self._limit <= 0.0:
            raise SceneError(f"margin_deg = {params.margin_deg:g} leaves nothing of los.outer_deg")
        self._gains = EnvelopeGains(gamma=params.braking * setup.limits.dw_max_radps2, rho=params.rho_rad)

    def start(self, sensed: Sensed) -> BarrierState:
        """Return the state at the beginning of an approach."""
        return BarrierState(guidance_start(offset_point(sensed.pose, self.setup.offset)))

    def step(self, state: BarrierState, sensed: Sensed, dt: float) -> tuple[Array, BarrierState]:
        """Advance by ``dt`` [s]; return (v, w), shape (..., 2), and the next state."""
        params, setup, limits = self.params, self.setup, self.setup.limits
        visibility = number(sensed.visibility)
        x, y, yaw = split(sensed.pose)
        tip = join(x + setup.offset * cos(yaw), y + setup.offset * sin(yaw))
        guidance = guidance_step(state.guidance, tip, visibility, params.guidance, setup.pin_reach, dt)
        tip_x, tip_y = split(tip)
        wish_x = -params.k_n_per_s * limit(tip_x - number(guidance.x), -_FARTHEST, _FARTHEST)
        wish_y = -params.k_n_per_s * limit(tip_y, -_FARTHEST, _FARTHEST)
        v, across = rotated(wish_x + number(guidance.speed), wish_y, -yaw)
        v = limit(v, -limits.v_close_mps, limits.v_close_mps)
        w = limit(across / setup.offset, -limits.w_max_radps, limits.w_max_radps)
        low, high = self._turn_bounds(v, sensed)
        kept = where(low > high, 0.5 * low + 0.5 * high, limit(w, low, high))
        w = limit(where(visibility > 0.0, kept, w), -limits.w_max_radps, limits.w_max_radps)
        return join(v, w), BarrierState(guidance)

    def turn_bounds(self, v: Array, sensed: Sensed) -> tuple[Array, Array]:
        """Return the turn rates [rad/s] between which both edges stay in the cone; they may cross."""
        low, high = self._turn_bounds(number(v), sensed)
        return np.asarray(low), np.asarray(high)

    def _turn_bounds(self, v: Number, sensed: Sensed) -> tuple[Number, Number]:
        los, ahead = self.setup.los, self.setup.camera_offset
        x, y, yaw = split(sensed.pose)
        camera_x, camera_y = x + ahead * cos(yaw), y + ahead * sin(yaw)
        bounds = []
        left, right = split(sensed.edges)
        for angle, sign in ((left, 1.0), (right, -1.0)):
            b = sign * los.half_width_m
            distance = at_least(hypot(los.setback_m - camera_x, b - camera_y), los.half_width_m)
            allowed = sign * envelope(sign * angle - self._limit, self._gains)
            lever = 1.0 + ahead * cos(angle) / distance
            bounds.append((v * sin(angle) / distance - allowed) / lever)
        return bounds[0], bounds[1]

    def reference(self, state: BarrierState) -> Array:
        """Return the guidance trajectory's point in D, shape (..., 2) [m]."""
        return np.stack([state.guidance.x, np.zeros_like(state.guidance.x)], axis=-1)
