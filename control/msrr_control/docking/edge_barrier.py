"""The barrier that keeps both edges of the target inside the visibility cone, whatever a unit wants to do."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from msrr_control.docking.law import DockSetup
from msrr_control.feedback.envelope import EnvelopeGains, envelope
from msrr_control.kinematics.elementwise import (
    Number,
    at_least,
    at_most,
    atan2,
    cos,
    hypot,
    limit,
    sin,
    where,
)
from msrr_scenes.errors import SceneError


class Sighting(NamedTuple):
    """An edge of the target as the camera sees it: bearing [rad] and distance [m], any shape."""

    angle: Any
    distance: Any

    def moved(self, length: Number, turn: Number, camera_offset: float) -> Sighting:
        """Return the sighting after the unit has moved along an arc.

        Args:
            length: Length of the arc, negative backwards [m].
            turn: Angle of the arc, counter-clockwise positive [rad].
            camera_offset: l_c, distance of the camera ahead of the axle [m].
        """
        half = 0.5 * turn
        x = camera_offset + self.distance * cos(self.angle) - length * cos(half)
        y = self.distance * sin(self.angle) - length * sin(half)
        c, s = cos(turn), sin(turn)
        ahead, left = c * x + s * y - camera_offset, c * y - s * x
        return Sighting(atan2(left, ahead), hypot(ahead, left))


class EdgeBarrier:
    def __init__(self, setup: DockSetup, braking: float, rho_rad: float, margin: float) -> None:
        self.bound = setup.los.outer - margin
        if self.bound <= 0.0:
            raise SceneError(
                f"margin_deg = {math.degrees(margin):g} leaves nothing of los.outer_deg"
            )
        self._setup = setup
        limits = setup.limits
        period = 1.0 / setup.rate_hz
        self.lead_s = period / -math.expm1(-limits.kappa_per_s * period)
        self.gains = EnvelopeGains(gamma=braking * limits.dw_max_radps2, rho=rho_rad)
        self._quickening = (1.0 - braking) * limits.dw_max_radps2 / math.sin(self.bound)

    def limited(
        self, v: Number, w: Number, twist: tuple[Number, Number], left: Sighting, right: Sighting
    ) -> tuple[Any, Any]:
        setup, lead = self._setup, self.lead_s
        now_v, now_w = twist
        free, hold = [], []
        fastest = None
        for sighting, sign in ((left, 1.0), (right, -1.0)):
            then = sighting.moved(lead * now_v, lead * now_w, setup.camera_offset)
            now, ahead = self._away(sighting.distance), self._away(then.distance)
            outward = sign * then.angle
            lever = 1.0 + setup.camera_offset * cos(then.angle) / ahead
            free.append(envelope(outward - self.bound, self.gains) / lever)
            hold.append(at_least(sin(outward), math.sin(self.bound)) / (ahead * lever))
            v = at_most(v, ahead * at_least(now_v / now + lead * self._quickening, 0.0))
        v = at_most(v, at_least((free[0] + free[1]) / (hold[0] + hold[1]), 0.0))
        reached = at_least(v, at_least(now_v - lead * setup.limits.a_max_mps2, 0.0))
        low, high = reached * hold[0] - free[0], free[1] - reached * hold[1]
        self.crossed = low > high
        return v, where(low > high, 0.5 * low + 0.5 * high, limit(w, low, high))

    def _away(self, distance: Number) -> Number:
        return at_least(distance, self._setup.los.half_width_m)
