"""The line-of-sight target and the cone in which it has to stay."""

from __future__ import annotations

import math

from pydantic import Field

from msrr_scenes.specs.spec import NonNegative, Positive, Spec


class LosSpec(Spec):
    """Target edges and cone of the close-range phase (Zheng et al., eqs. 21-22).

    The target is the pair of points (setback, +-half_width) in the dock frame D: the outer black edges of the
    marker's side tags.

    Attributes:
        half_width_m: b.
        setback_m: s_b, behind the face.
        inner_deg: th_in, where the correction starts.
        outer_deg: th_out, where it is largest.
    """

    half_width_m: Positive = 0.0441
    setback_m: NonNegative = 0.0442
    inner_deg: float = Field(default=20.0, gt=0.0, lt=90.0)
    outer_deg: float = Field(default=30.0, gt=0.0, lt=90.0)

    @property
    def inner(self) -> float:
        """th_in [rad]."""
        return math.radians(self.inner_deg)

    @property
    def outer(self) -> float:
        """th_out [rad]."""
        return math.radians(self.outer_deg)

    def angle_at_contact(self, camera_to_face: float) -> float:
        """Return the edge angle [rad] of an aligned unit, its camera ``camera_to_face`` [m] off the face."""
        return math.atan2(self.half_width_m, camera_to_face + self.setback_m)
