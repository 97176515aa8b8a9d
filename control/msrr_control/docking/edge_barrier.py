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
from msrr_scenes.errors import ParameterError


class Arc(NamedTuple):
    """A motion along an arc in the frame of the unit before it, floats or of any shape.

    Attributes:
        ahead: Distance moved ahead [m].
        left: Distance moved to the left [m].
        cos: Cosine of the angle turned.
        sin: Sine of the angle turned.
    """

    ahead: Any
    left: Any
    cos: Any
    sin: Any

    @classmethod
    def of(cls, length: Number, turn: Number) -> Arc:
        """Return the arc of a length [m], negative backwards, and an angle [rad], counter-clockwise positive.

        The chord is taken to be as long as the arc, of which 0.2 rad of turn make 2 parts in 1000.
        """
        half = 0.5 * turn
        return cls(length * cos(half), length * sin(half), cos(turn), sin(turn))


class Sighting(NamedTuple):
    """An edge of the target as the camera sees it: bearing [rad] and distance [m], floats or of any shape."""

    angle: Any
    distance: Any

    def after(self, arc: Arc, camera_offset: float) -> Sighting:
        """Return the sighting after a motion; the camera is ``camera_offset`` [m] ahead of the axle."""
        x = camera_offset + self.distance * cos(self.angle) - arc.ahead
        y = self.distance * sin(self.angle) - arc.left
        ahead, left = arc.cos * x + arc.sin * y - camera_offset, arc.cos * y - arc.sin * x
        return Sighting(atan2(left, ahead), hypot(ahead, left))


class EdgeBarrier:
    r"""Bounds speed and turn rate so that neither edge of the target crosses a bound inside the cone.

    **The set.** Let a be the outward angle of an edge at the distance r, :math:`\bar a` the bound and
    :math:`x = a - \bar a`. The edge moves at :math:`\dot x = v\sin a/r - \lambda w`,
    :math:`\lambda = 1 + l_c\cos a/r` (signs of the left edge; the right one is its mirror image). The state
    is in the set if for both edges

    .. math:: x \le 0,\quad z = D - \lambda w \le F(x),\quad D = v\sin\bar a/r

    with the envelope F of Lemma 1. As :math:`\dot x \le z` inside the bound and :math:`F(0) = 0`, no edge
    crosses its bound from there.

    **It is not left.** A drive of bandwidth kappa that follows a command :math:`w_c` for the period T goes
    the part :math:`T/T_l` of the way to it, with the lead :math:`T_l = T/(1 - e^{-\kappa T})`, about
    :math:`1/\kappa + T/2`. The command is bounded by :math:`\lambda w_c \ge D_l - F(x + T_l\dot x)`: the edge
    and its D as they will be a lead ahead. D grows ever faster as the unit comes nearer and F is concave, so
    that after the period

    .. math:: z^+ \le (1 - T/T_l)\,z + (T/T_l)\,F(x + T_l\dot x) \le F(x + T\dot x)

    up to what sampling adds. Where this asks for more than the rate limit gives, the drive turns at dw_max.
    The envelope needs the share ``braking`` of that, for :math:`|F'F| \le \gamma`; the rest is left for the
    growth of D, and v is bounded so that D grows no faster. Both shares are those of :math:`\lambda\dot w`,
    which is less than that of w before a camera behind the axle, and least at contact. v is also bounded so
    that both edges leave a turn rate between their bounds.

    **What is assumed.** The drive is that of eq. 3 with these limits, and a_max brakes as fast as the bounds
    of v fall; the sightings and the twist are those of the time when the command reaches the drive; the
    command is held for one period. Then the bound holds whatever is wanted. Sampling at 50 Hz adds less than
    0.05 deg; the margin between bound and cone is there for this, for noise, and for slip.

    Source: Lemma 1 (Zheng et al., eqs. 4 to 6) for F; set, lead and bounds are not in the paper.
    """

    def __init__(self, setup: DockSetup, braking: float, rho_rad: float, margin: float) -> None:
        """Derive the envelope from the drive's limits.

        The numbers are those of :class:`~msrr_control.docking.barrier.BarrierParams`, with the margin in
        radians.

        Raises:
            ParameterError: The margin leaves nothing of the cone.
        """
        self.bound = setup.los.outer - margin
        if self.bound <= 0.0:
            raise ParameterError({"margin_deg": f"{math.degrees(margin):g} leaves nothing of los.outer_deg"})
        limits, period = setup.limits, 1.0 / setup.rate_hz
        reach = setup.offset - setup.camera_offset + setup.los.setback_m
        quickest = (1.0 + min(setup.camera_offset, 0.0) / reach) * limits.dw_max_radps2
        self.gains = EnvelopeGains(gamma=braking * quickest, rho=rho_rad)
        self.lead_s = period / -math.expm1(-limits.kappa_per_s * period)
        self._a_max, self._w_max = limits.a_max_mps2, limits.w_max_radps
        self._camera_offset = setup.camera_offset
        # Nearer than this no camera sees both edges; it keeps an absurd estimate from a division by zero.
        self._nearest = setup.los.half_width_m
        # Growth of v / r in a lead for which the envelope leaves some of the drive's acceleration.
        self._sin_bound = math.sin(self.bound)
        self._quickening = self.lead_s * (1.0 - braking) * quickest / self._sin_bound

    def limited(
        self, wanted: tuple[Any, Any], twist: tuple[Any, Any], edges: tuple[Sighting, Sighting]
    ) -> tuple[Any, Any]:
        """Return the command (v, w) nearest to the wanted one that keeps the edges within the bound.

        Args:
            wanted: (v, w) that is wanted [m/s, rad/s].
            twist: (v, w) at the time when the command takes effect [m/s, rad/s].
            edges: Left and right edge of the target at that time.

        Returns:
            v is not raised and w lies between the bounds of both edges; where these cross, in their middle.
        """
        (v, w), (v_now, w_now), lead = wanted, twist, self.lead_s
        arc = Arc.of(lead * v_now, lead * w_now)
        hold, free = [], []
        for edge, side in zip(edges, (1.0, -1.0), strict=True):
            then = edge.after(arc, self._camera_offset)
            distance = at_least(then.distance, self._nearest)
            outward = side * then.angle
            lever = 1.0 + self._camera_offset * cos(then.angle) / distance
            hold.append(at_least(sin(outward), self._sin_bound) / (distance * lever))
            free.append(envelope(outward - self.bound, self.gains) / lever)
            v = at_most(v, at_least((self._w_max + free[-1]) / hold[-1], 0.0))
            closing = v_now / at_least(edge.distance, self._nearest)
            v = at_most(v, distance * at_least(closing + self._quickening, 0.0))
        v = at_most(v, at_least((free[0] + free[1]) / (hold[0] + hold[1]), 0.0))
        reached = at_least(at_least(v, v_now - lead * self._a_max), 0.0)
        low, high = reached * hold[0] - free[0], free[1] - reached * hold[1]
        return v, where(low > high, 0.5 * low + 0.5 * high, limit(w, low, high))
