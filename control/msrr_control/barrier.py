"""Linear tracking with a line-of-sight barrier: the safety envelope on the two edge angles."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from msrr_control.envelope import EnvelopeGains, envelope
from msrr_control.guidance import GuidanceSpec, GuidanceState, guidance_start, guidance_step
from msrr_control.law import DockSetup, Sensed, limit_twist
from msrr_control.offset_point import offset_point, twist_for
from msrr_scenes.errors import SceneError
from msrr_scenes.spec import NonNegative, Positive, Spec

Array = NDArray[np.float64]

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
        params, setup = self.params, self.setup
        yaw = sensed.pose[..., 2]
        tip = offset_point(sensed.pose, setup.offset)
        guidance = guidance_step(state.guidance, tip, sensed.visibility, params.guidance, setup.pin_reach, dt)
        error = tip - self.reference(BarrierState(guidance))
        velocity = -params.k_n_per_s * np.minimum(np.maximum(error, -_FARTHEST), _FARTHEST)
        velocity[..., 0] += guidance.speed
        twist = limit_twist(twist_for(velocity, yaw, setup.offset), setup.limits)
        low, high = self.turn_bounds(twist[..., 0], sensed)
        middle = 0.5 * low + 0.5 * high
        kept = np.where(low > high, middle, np.minimum(np.maximum(twist[..., 1], low), high))
        twist[..., 1] = np.where(sensed.visibility > 0.0, kept, twist[..., 1])
        return limit_twist(twist, setup.limits), BarrierState(guidance)

    def turn_bounds(self, v: Array, sensed: Sensed) -> tuple[Array, Array]:
        """Return the turn rates [rad/s] between which both edges stay in the cone; they may cross."""
        los, camera = self.setup.los, offset_point(sensed.pose, self.setup.camera_offset)
        bounds = []
        for side, b in ((0, los.half_width_m), (1, -los.half_width_m)):
            angle = sensed.edges[..., side]
            sign = 1.0 if side == 0 else -1.0
            distance = np.hypot(los.setback_m - camera[..., 0], b - camera[..., 1])
            distance = np.maximum(distance, los.half_width_m)
            allowed = sign * envelope(sign * angle - self._limit, self._gains)
            lever = 1.0 + self.setup.camera_offset * np.cos(angle) / distance
            bounds.append((v * np.sin(angle) / distance - allowed) / lever)
        return bounds[0], bounds[1]

    def reference(self, state: BarrierState) -> Array:
        """Return the guidance trajectory's point in D, shape (..., 2) [m]."""
        return np.stack([state.guidance.x, np.zeros_like(state.guidance.x)], axis=-1)
